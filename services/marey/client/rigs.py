"""Rigs: characters that the server puts motions on."""

from __future__ import annotations

import json
import re
from collections.abc import Generator, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from marey.client.resources import Resource, identifier
from marey.client.types.rigs import Rig, RigDetail
from marey.core.documents import read_bytes, read_json
from marey.core.errors import InvalidInput, MareyError
from marey.motion.export_options import RIG_NAME, RIG_NAME_WORDS

MAX_BYTES = 64 * 2**20
"""Of the file of a rig."""


class Rigs(Resource):
    """`client.rigs`. Errors of all methods: NotFound, InvalidInput, Refused, Unreachable."""

    def add(
        self,
        path: str | Path,
        name: str | None = None,
        *,
        rig_map: str | Path | Mapping[str, str | None] | None = None,
    ) -> RigDetail:
        """Add the skeleton of a character, to put motions on: `client.motions.make_file(…, rig="hero")`.

        The same file and map under a name change nothing; others are a new version, and files made on the version
        before it are removed.

        Args:
            path: glb, gltf, vrm, fbx, bvh or JSON.
            name: letters from A to Z, digits, `_` and `-`; None = that of the file.
            rig_map: joints of parts of the body that are not found, or a JSON file of them; None as a joint = no such
                part.

        Raises:
            InvalidInput: the name has other characters.
            InvalidFile, TooLarge: the file is broken, has no skeleton, or is over the limit of the server.
            Conflict: there are as many rigs as the server allows.
            QuotaUsedUp: the tenant's quota of bytes is exhausted.
        """
        path = Path(path)
        if not re.fullmatch(RIG_NAME, path.stem if name is None else name):
            hint = f"Allowed are {RIG_NAME_WORDS}."
            if name is not None:
                raise InvalidInput(f"{name[:80]!r} cannot name a rig", where="name", hint=hint, argument="name")
            hint = f"Give the rig another one by name. {hint}"
            raise InvalidInput("a rig cannot have the name of this file", where=str(path), hint=hint, argument="name")
        data = read_bytes(path, limit=MAX_BYTES, hint="Export the skeleton without the scene.")
        asked = {"name": path.stem if name is None else name, "format": path.suffix.removeprefix(".").lower()}
        if rig_map is not None:
            given = rig_map if isinstance(rig_map, Mapping) else read_json(Path(rig_map), unique=True)
            asked["map"] = json.dumps(given, ensure_ascii=False, separators=(",", ":"))
        where = {"body": str(path), "format": str(path)}
        if isinstance(rig_map, str | Path):
            where["map"] = str(rig_map)
        with _naming(where):
            return RigDetail.of(self._transport.post_file("/v1/rigs", data, **asked))

    def list(self, *, limit: int | None = None) -> Iterator[Rig]:
        """Iterate over the rigs, newest first; without the reference rigs.

        Args:
            limit: the largest number of rigs; None = all.
        """
        return self._pages(Rig, "/v1/rigs", limit)

    def get(self, rig: Rig | str) -> RigDetail:
        """Return a rig with what is found in it."""
        return RigDetail.of(self._transport.get(_path(rig)))

    def remove(self, rig: Rig | str) -> None:
        """Remove a rig, and the files that the server made on it."""
        self._transport.delete(_path(rig))


def _path(rig: Rig | str) -> str:
    return f"/v1/rigs/{identifier(rig.name if isinstance(rig, Rig) else rig)}"


@contextmanager
def _naming(places: Mapping[str, str]) -> Generator[None]:
    """Name the file in the server's errors, where they name a field of the request."""
    try:
        yield
    except MareyError as error:
        error.where = places.get(error.where or "", error.where)
        raise
