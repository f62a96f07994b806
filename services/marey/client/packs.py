"""Many small files in one request: a tar of stored files (`POST /v1/motions/files`)."""

from __future__ import annotations

import io
import tarfile
from collections import defaultdict
from collections.abc import Generator, Iterable, Iterator, Sequence

from marey.client.file_to_fetch import FileToFetch
from marey.client.transport import Transport
from marey.core.errors import InvalidFile

SMALL = 2**20
"""Bytes of a file up to which it is fetched with others; larger ones are resumed on their own."""
LEAST = 4
"""Files from which on one request for all is better than one for each."""
MOST = 64
MAX_BYTES = 2**24
PATH = "/v1/motions/files"
OVERHEAD = 4 * tarfile.BLOCKSIZE
"""Bytes of a member beside its content, and some; of the end of a tar, too."""


def packs_of(files: Iterable[FileToFetch]) -> list[list[FileToFetch]]:
    """Split files into groups: small stored files of motions that have equal formats together, each other one alone.

    A motion's files stay together.
    """
    by_motion: defaultdict[str, list[FileToFetch]] = defaultdict(list)
    alone: list[list[FileToFetch]] = []
    for file in files:
        if file.motion is None or file.asked is not None or file.size > SMALL:
            alone.append([file])
        else:
            by_motion[file.motion].append(file)
    by_formats: defaultdict[tuple[str, ...], list[list[FileToFetch]]] = defaultdict(list)
    for group in by_motion.values():
        by_formats[tuple(file.stored_format for file in group)].append(group)
    packs = [pack for groups in by_formats.values() for pack in _filled(groups)]
    large = [pack for pack in packs if len(pack) >= LEAST]
    return large + [[file] for pack in packs if len(pack) < LEAST for file in pack] + alone


def _filled(groups: Iterable[list[FileToFetch]]) -> Iterator[list[FileToFetch]]:
    """Yield packs of the files of motions, within the limits."""
    pack: list[FileToFetch] = []
    for group in groups:
        if pack and (len(pack) + len(group) > MOST or sum(file.size for file in [*pack, *group]) > MAX_BYTES):
            yield pack
            pack = []
        pack = [*pack, *group]
    if pack:
        yield pack


def receive_pack(transport: Transport, files: Sequence[FileToFetch]) -> Generator[tuple[FileToFetch, bytes]]:
    """Yield the files of a pack with their content, as they arrive; the sha256 is not checked.

    Raises:
        InvalidFile: the answer is no such tar.
        MareyError: of the server, which may be an older one that has no packs.
    """
    wanted = {f"{file.motion}.{file.stored_format}": file for file in files}
    body = {
        "motions": list(dict.fromkeys(file.motion for file in files)),
        "formats": list(dict.fromkeys(file.stored_format for file in files)),
    }
    limit = sum(file.size for file in files) + OVERHEAD * (len(files) + 1)
    with transport.stream(PATH, json=body) as response:
        try:
            with tarfile.open(fileobj=_Reader(response.iter_bytes(), limit), mode="r|") as tar:
                for member in tar:
                    yield _member(tar, member, wanted)
        except tarfile.TarError as error:
            raise InvalidFile(f"the server sent no tar: {error}", where=PATH) from error


def _member(tar: tarfile.TarFile, member: tarfile.TarInfo, wanted: dict[str, FileToFetch]) -> tuple[FileToFetch, bytes]:
    """Return a file that was asked for, and its content; no name in the tar becomes a path."""
    file = wanted.pop(member.name, None)
    content = tar.extractfile(member) if file is not None and member.size == file.size else None
    if file is None or content is None:
        raise InvalidFile("the server sent a file that was not asked for", where=f"{PATH}: {member.name[:80]!r}")
    return file, content.read()


class _Reader(io.RawIOBase):
    """The body of an answer as a file to read from, up to a limit."""

    def __init__(self, chunks: Iterator[bytes], limit: int) -> None:
        super().__init__()
        self._chunks, self._left = chunks, limit
        self._ready = bytearray()

    def read(self, size: int = -1, /) -> bytes:
        """Return the next bytes, fewer at the end.

        Raises:
            InvalidFile: the answer is longer than the limit.
        """
        while len(self._ready) < size and (chunk := next(self._chunks, None)) is not None:
            self._left -= len(chunk)
            if self._left < 0:
                raise InvalidFile("the server sends more than was asked for", where=PATH)
            self._ready += chunk
        found = bytes(self._ready[:size])
        del self._ready[:size]
        return found
