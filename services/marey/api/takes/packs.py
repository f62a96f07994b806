"""Stored files of many motions in one answer: a tar, so that a client needs one request for a hundred files."""

from __future__ import annotations

import tarfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Annotated
from uuid import UUID

from fastapi.responses import StreamingResponse
from pydantic import BaseModel, ConfigDict, Field

from marey import jobs
from marey.api.context import Context
from marey.api.files import read_chunks
from marey.core.disposition import attachment
from marey.core.errors import NotFound, TooLarge
from marey.core.validation import worded
from marey.db import transaction
from marey.jobs import asset_key
from marey.jobs.types import MotionFile
from marey.storage import CHUNK, AssetStore

FORMAT = worded(r"^[a-z0-9]{1,16}$", "names of formats, as npz, bvh, glb or mp4")
MAX_MOTIONS = 200
MAX_FORMATS = 8
MAX_BYTES = 2**26
BLOCK = tarfile.BLOCKSIZE
END = bytes(2 * BLOCK)
"""Two empty blocks end a tar."""


class NewPackBody(BaseModel):
    """Stored files that are wanted together."""

    model_config = ConfigDict(extra="forbid")

    motions: list[UUID] = Field(min_length=1, max_length=MAX_MOTIONS)
    formats: list[Annotated[str, Field(pattern=FORMAT)]] = Field(
        min_length=1, max_length=MAX_FORMATS, description="Each motion has a stored file in each of them."
    )


@dataclass(frozen=True)
class PackedFile:
    """A stored file as a member of a pack."""

    name: str
    file: MotionFile

    @property
    def head(self) -> bytes:
        """The header of the member."""
        member = tarfile.TarInfo(self.name)
        member.size = self.file.size
        return member.tobuf(tarfile.USTAR_FORMAT)

    @property
    def padding(self) -> int:
        """Bytes behind the content, up to a whole block."""
        return -self.file.size % BLOCK


def packed_files(shared: Context, tenant: str, body: NewPackBody) -> list[PackedFile]:
    """Return the files of a pack: those of the first motion first, in the order of the formats.

    Raises:
        NotFound: the tenant has no such motion, or it has no stored file of a format.
        TooLarge: they are larger than `MAX_BYTES` together.
    """
    with transaction(shared.engine) as conn:
        rows = jobs.motions_of(conn, tenant, body.motions)
    found = [_packed(row, format) for row in rows for format in dict.fromkeys(body.formats)]
    size = sum(each.file.size for each in found)
    if size > MAX_BYTES:
        raise TooLarge(
            f"these files have {size:,} bytes; at most {MAX_BYTES:,} are sent together",
            where="motions",
            hint="Ask for fewer at a time, or for one by GET /v1/motions/{motion}/files/{format}.",
        )
    return found


def _packed(row: jobs.MotionRow, format: str) -> PackedFile:
    file = row.file(format)
    if file is None:
        have = ", ".join(each.format for each in row.files)
        hint = f"It has {have}; GET /v1/motions/{{motion}}/files/{{format}} makes others."
        raise NotFound(f"the motion has no stored {format}", where=str(row.id), hint=hint)
    return PackedFile(f"{row.id}.{format}", file)


def pack_response(shared: Context, tenant: str, files: Sequence[PackedFile]) -> StreamingResponse:
    """Answer with the files; one whose content is missing in the store is left out, and its own route says so."""
    headers = {"Content-Disposition": attachment("motions.tar"), "Cache-Control": "no-store"}
    return StreamingResponse(_joined(_tar(shared.store, tenant, files)), 200, headers, "application/x-tar")


def _tar(store: AssetStore, tenant: str, files: Sequence[PackedFile]) -> Iterator[bytes]:
    for each in files:
        try:
            opened = store.open(asset_key(tenant, each.file.sha256))
        except NotFound:
            continue
        yield each.head
        yield from read_chunks(opened)
        yield bytes(each.padding)
    yield END


def _joined(pieces: Iterator[bytes]) -> Iterator[bytes]:
    """Join pieces to about `CHUNK`: each that is sent changes threads twice."""
    ready = bytearray()
    for piece in pieces:
        ready += piece
        if len(ready) >= CHUNK:
            yield bytes(ready)
            ready.clear()
    yield bytes(ready)
