"""Downloads of files, eight requests at a time: into `.part` files, resumed, checked by sha256."""

from __future__ import annotations

import hashlib
import logging
import os
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

from marey.client.file_requests import made_file
from marey.client.file_to_fetch import FileToFetch
from marey.client.packs import packs_of, receive_pack
from marey.client.transport import Transport
from marey.core.errors import Conflict, InvalidFile, MareyError, Unreachable
from marey.core.hashing import sha256_of
from marey.motion.files import write_atomically

PARALLEL = 8
ATTEMPTS = 4
"""Downloads of one file that may break off; each continues where the last one stopped."""
BLOCK = 2**18
MAKING_SECONDS = 600.0
"""Seconds to wait for a file that the server makes."""
log = logging.getLogger(__name__)


def download_all(
    client: Transport, downloads: Sequence[FileToFetch], *, overwrite: bool, done: Callable[[FileToFetch], None]
) -> None:
    """Fetch files, eight requests at a time, after a check of the existing ones; many small ones by one request.

    Args:
        overwrite: replace files with other content.
        done: called after each file, by the thread that fetched it; never after this function has returned.

    Raises:
        Conflict: a file exists with other content; nothing is fetched then.
        InvalidFile: the data that arrived has another sha256, or cannot be written.
    """
    missing: list[FileToFetch] = []
    for download in downloads:
        if _is_there(download, overwrite):
            done(download)
        else:
            missing.append(download)

    def fetch(pack: list[FileToFetch]) -> None:
        arrived = _unpack(client, pack, overwrite=overwrite, done=done) if len(pack) > 1 else set[Path]()
        for download in pack:
            if download.path in arrived:
                continue
            if download.asked is None:
                _download(client, download, overwrite=overwrite)
            else:
                made = made_file(client, download.url, download.path, download.asked, timeout=MAKING_SECONDS)
                if not _is_there(made, overwrite):
                    _download(client, made, overwrite=overwrite)
            done(download)

    with ThreadPoolExecutor(PARALLEL) as pool:
        try:
            for _ in pool.map(fetch, packs_of(missing)):
                pass
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _is_there(download: FileToFetch, overwrite: bool) -> bool:
    if download.making is not None or download.asked is not None:  # only making it again tells
        return False
    try:
        if download.path.stat().st_size == download.size and sha256_of(download.path) == download.sha256:
            return True
    except FileNotFoundError:
        return False
    if not overwrite:
        raise _conflict(download.path)
    return False


def _conflict(path: Path) -> Conflict:
    return Conflict(
        "already exists and holds something else",
        where=str(path),
        hint="Choose another folder, or pass overwrite=True.",
        argument="overwrite",
    )


def _finish(download: FileToFetch, part: Path, overwrite: bool) -> None:
    """Put a file that has arrived in its place, or what is made of it."""
    path = download.path
    if download.making is None:
        part.replace(path)
        return
    try:
        content = download.making.make(part.read_bytes(), str(path))
    finally:
        part.unlink()
    if not path.exists() or path.read_bytes() != content:
        if path.exists() and not overwrite:
            raise _conflict(path)
        write_atomically(path, content)


def _unpack(
    client: Transport, pack: Sequence[FileToFetch], *, overwrite: bool, done: Callable[[FileToFetch], None]
) -> set[Path]:
    """Fetch files by one request, and return the paths of those that arrived.

    A request that fails, or that an older server does not know, leaves the others, which are then fetched one by one,
    with retries, and with an error of their own.
    """
    arrived: set[Path] = set()
    received = receive_pack(client, pack)
    while (found := _next_of(received)) is not None:
        download, content = found
        if hashlib.sha256(content).hexdigest() == download.sha256:
            part = _part_of(download)
            with _written(part), part.open("wb") as stream:
                stream.write(content)
                stream.flush()
                os.fsync(stream.fileno())
            _finish(download, part, overwrite)
            done(download)
            arrived.add(download.path)
    return arrived


def _next_of(received: Iterator[tuple[FileToFetch, bytes]]) -> tuple[FileToFetch, bytes] | None:
    try:
        return next(received, None)
    except MareyError as error:
        log.info("the rest of a pack of files is fetched one by one: %s", error)
        return None


def _part_of(download: FileToFetch) -> Path:
    return download.path.with_name(download.path.name + ".part")


@contextmanager
def _written(part: Path) -> Generator[None]:
    """Report a failed write within as `InvalidFile`."""
    try:
        yield
    except OSError as error:
        raise InvalidFile(f"cannot be written: {error.strerror}", where=str(part)) from error


def _download(client: Transport, download: FileToFetch, *, overwrite: bool) -> None:
    part = _part_of(download)
    for attempt in range(1, ATTEMPTS + 1):
        try:
            with _written(part):
                _continue(client, download, part)
        except Unreachable:
            if attempt == ATTEMPTS:
                raise
            continue
        if sha256_of(part) == download.sha256:
            return _finish(download, part, overwrite)
        part.unlink()  # a remainder of another file, or damaged in transit: start again
    raise InvalidFile(
        "the data that arrived has another sha256 than the server says",
        where=str(download.path),
        hint="Fetch it again later.",
    )


def _continue(client: Transport, download: FileToFetch, part: Path) -> None:
    have = part.stat().st_size if part.exists() else 0
    if have >= download.size:
        have = 0
    headers = {"Range": f"bytes={have}-"} if have else {}
    with client.stream(download.url, headers) as response:
        resumed = response.status_code == 206
        with part.open("ab" if resumed else "wb") as stream:
            left = download.size - (have if resumed else 0)
            for block in response.iter_bytes(BLOCK):
                stream.write(block)
                left -= len(block)
                if left < 0:  # the sha256 cannot be right any more, and the rest may have no end
                    break
            stream.flush()
            os.fsync(stream.fileno())
