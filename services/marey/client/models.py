"""Models: the bundles that a server makes motions with."""

from __future__ import annotations

from collections.abc import Iterator
from urllib.parse import quote

from marey.client.resources import Resource
from marey.client.types import Model


class Models(Resource):
    """`client.models`."""

    def list(self) -> Iterator[Model]:
        """The bundles of the server."""
        for each in self._transport.get("/v1/models").get("items", ()):
            yield Model.of(each)

    def get(self, name: str) -> Model:
        """A bundle by the name of a model, a bundle or an exact bundle."""
        return Model.of(self._transport.get(f"/v1/models/{quote(name, safe='')}"))
