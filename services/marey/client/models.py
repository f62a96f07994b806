"""Models: the bundles that a server makes motions with."""

from __future__ import annotations

from collections.abc import Iterator

from marey.client.resources import Resource, identifier
from marey.client.types.models import Model, ModelCatalogue


class Models(Resource):
    """`client.models`. Errors of all methods: Refused, Unreachable."""

    def list(self) -> Iterator[Model]:
        """Iterate over the bundles of the server."""
        yield from self.catalogue().items

    def get(self, name: str) -> Model:
        """Return a bundle.

        Args:
            name: of a model, a bundle or an exact bundle.

        Raises:
            NotFound: there is no such bundle.
        """
        return Model.of(self._transport.get(f"/v1/models/{identifier(name)}"))

    def catalogue(self) -> ModelCatalogue:
        """Return the bundles of the server, and those that it leaves out because they are broken."""
        return ModelCatalogue.of(self._transport.get("/v1/models"))
