"""The asset store in a folder: temporary file, fsync, rename."""

from __future__ import annotations

import hashlib
import io
import os
import secrets
import tempfile
import time
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import BinaryIO, TypeVar

from marey.core.errors import Unreachable
from marey.core.metrics import STORE_ERRORS
from marey.storage.port import (
    CHUNK,
    PRESIGN_SECONDS,
    PUBLIC,
    Digest,
    NewObject,
    Opened,
    check_content,
    checked_key,
    no_such_object,
    range_past_end,
    read_chunks,
)

ABANDONED_SECONDS = 3600.0  # age after which a temporary file is left over
INCOMING = ".incoming"
"""Folder of temporary files; its name is not a key, so listings never include it."""
FILES_AT_ONCE = 64  # two per item of a batch; macOS lets a process open 256
SYNCS_AT_ONCE = 32  # threads that only wait for the disk; 64 are no faster
CREATE = os.O_CREAT | os.O_EXCL | os.O_WRONLY | getattr(os, "O_BINARY", 0)  # O_BINARY: Windows only

Value = TypeVar("Value")
Result = TypeVar("Result")


class FolderStore:
    """Objects are files under `root`, named by their keys."""

    def __init__(self, root: Path) -> None:
        self.root = root.absolute()
        self._syncs = ThreadPoolExecutor(SYNCS_AT_ONCE, thread_name_prefix="fsync")

    def prepare(self) -> None:
        """See `AssetStore.prepare`."""
        with _outages(self.root):
            incoming = self.root / INCOMING
            incoming.mkdir(parents=True, exist_ok=True)
            for left in incoming.iterdir():
                if left.stat().st_mtime < time.time() - ABANDONED_SECONDS:
                    left.unlink(missing_ok=True)

    def put(self, key: str, source: bytes | Path, *, media_type: str = "application/octet-stream") -> Digest:
        """See `AssetStore.put`. The media type is not stored."""
        with io.BytesIO(source) if isinstance(source, bytes) else source.open("rb") as content:
            return self._put_together([(key, content)])[0]

    def put_all(self, objects: Sequence[NewObject]) -> Iterator[str]:
        """See `AssetStore.put_all`."""
        for first in range(0, len(objects), FILES_AT_ONCE):
            group = objects[first : first + FILES_AT_ONCE]
            self._put_together([(one.key, io.BytesIO(one.content)) for one in group])
            yield from (one.key for one in group)

    def get(self, key: str) -> bytes:
        """See `AssetStore.get`."""
        with _outages(self.root, key):
            return self.path(key).read_bytes()

    def open(self, key: str, start: int = 0, length: int | None = None) -> Opened:
        """See `AssetStore.open`."""
        with _outages(self.root, key):
            file = self.path(key).open("rb")
            size = os.fstat(file.fileno()).st_size
            if start > size or (start == size and size > 0):
                file.close()
                raise range_past_end(key, start, size)
            file.seek(start)
        left = size - start
        return Opened(size, read_chunks(file, left if length is None else min(length, left)))

    def exists(self, key: str) -> bool:
        """See `AssetStore.exists`."""
        with _outages(self.root):
            return self.path(key).is_file()

    def size(self, key: str) -> int:
        """See `AssetStore.size`."""
        with _outages(self.root, key):
            return self.path(key).stat().st_size

    def delete(self, key: str) -> None:
        """See `AssetStore.delete`."""
        with _outages(self.root):
            self.path(key).unlink(missing_ok=True)

    def keys(self, prefix: str = "") -> Iterator[str]:
        """See `AssetStore.keys`."""
        with _outages(self.root):
            found = sorted(
                key
                for folder, folders, files in os.walk(self.root, onerror=_raise)
                for key in _keys_of(self.root, folder, folders, files)
                if key.startswith(prefix)
            )
        yield from found

    def presign(self, key: str, *, filename: str, media_type: str, seconds: int = PRESIGN_SECONDS) -> str | None:
        """Return None: a folder has no URLs."""
        checked_key(key)

    def check(self) -> None:
        """See `AssetStore.check`."""
        with _outages(self.root):
            incoming = self.root / INCOMING
            incoming.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=incoming) as file:
                file.write(b"marey")

    def path(self, key: str) -> Path:
        """Return the file of a key: always inside the folder, since `checked_key` rejects parts that begin with a
        dot."""
        return self.root / checked_key(key)

    def _put_together(self, contents: Sequence[tuple[str, BinaryIO]]) -> list[Digest]:
        """Run each step for all objects, so that the fsyncs of a step wait for the disk at the same time.

        A flush of the disk takes milliseconds and serves all requests made before it began: two files per item cost
            2 to 3 ms when each of eight threads flushed them one by one, 0.3 ms like this.
        """
        paths = [self.path(key) for key, _ in contents]
        with _outages(self.root), self._incoming(len(contents)) as temporaries:
            digests = self._write(temporaries, contents)
            for temporary, path in zip(temporaries, paths, strict=True):
                _move(temporary, path)
            self._at_once(_fsync_folder, {path.parent for path in paths})
        return digests

    @contextmanager
    def _incoming(self, count: int) -> Generator[list[Path]]:
        """Yield names for temporary files; those that were not moved away are removed on failure."""
        incoming = self.root / INCOMING
        names = [incoming / secrets.token_hex(8) for _ in range(count)]
        try:
            yield names
        except BaseException:
            for name in names:
                with suppress(OSError):  # report the first error
                    name.unlink()
            raise

    def _write(self, temporaries: Sequence[Path], contents: Sequence[tuple[str, BinaryIO]]) -> list[Digest]:
        """Write and fsync contents that match their keys."""
        with ExitStack() as opened:
            files: list[tuple[int, str, BinaryIO]] = []
            for temporary, (key, content) in zip(temporaries, contents, strict=True):
                files.append((_create(temporary), key, content))
                opened.callback(os.close, files[-1][0])
            return self._at_once(_write_one, files)

    def _at_once(self, action: Callable[[Value], Result], values: Iterable[Value]) -> list[Result]:
        """Run `action` for each value in parallel; return the results, or raise the first error, after all calls have
        ended."""
        futures = [self._syncs.submit(action, value) for value in values]
        wait(futures)
        return [future.result() for future in futures]


def _keys_of(root: Path, folder: str, folders: list[str], files: list[str]) -> Iterator[str]:
    if INCOMING in folders:
        folders.remove(INCOMING)
    relative = Path(folder).relative_to(root)
    for name in files:
        yield (relative / name).as_posix()


def _raise(error: OSError) -> None:
    if not isinstance(error, FileNotFoundError):  # the folder does not exist yet
        raise error


def _create(path: Path) -> int:
    """Create a file that only this user can read; return its descriptor."""
    try:
        return os.open(path, CREATE, 0o600)
    except FileNotFoundError:
        path.parent.mkdir(parents=True, exist_ok=True)
        return os.open(path, CREATE, 0o600)


def _write_one(file: tuple[int, str, BinaryIO]) -> Digest:
    """Write content that matches its key to a descriptor, durably."""
    descriptor, key, content = file
    digest = _copy(content, descriptor)
    check_content(key, digest)
    os.fsync(descriptor)
    return digest


def _copy(content: BinaryIO, descriptor: int) -> Digest:
    """Write all of the content; return its digest."""
    sha256, size = hashlib.sha256(), 0
    while chunk := content.read(CHUNK):
        sha256.update(chunk)
        size += len(chunk)
        left = memoryview(chunk)
        while left:
            left = left[os.write(descriptor, left) :]
    return Digest(sha256.hexdigest(), size)


def _move(temporary: Path, path: Path) -> None:
    try:
        temporary.replace(path)
    except FileNotFoundError:
        _make_folder(path.parent)
        temporary.replace(path)


def _make_folder(folder: Path) -> None:
    """Create a folder and its parents durably: without its directory entry its files would be lost."""
    if not folder.parent.is_dir():
        _make_folder(folder.parent)
    folder.mkdir(exist_ok=True)
    _fsync_folder(folder.parent)


def _fsync_folder(folder: Path) -> None:
    """Make a rename durable; some file systems refuse to open folders (Windows), and do not need it."""
    if os.name == "nt":
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


@contextmanager
def _outages(root: Path, key: str | None = None) -> Generator[None]:
    """Convert errors of the file system to `NotFound` (of `key`) or `Unreachable`."""
    try:
        yield
    except (FileNotFoundError, NotADirectoryError, IsADirectoryError) as error:
        if key is None:
            raise _unreachable(root, error) from error
        raise no_such_object(key) from error
    except OSError as error:
        raise _unreachable(root, error) from error


def _unreachable(root: Path, error: OSError) -> Unreachable:
    STORE_ERRORS.labels("folder").inc()
    return Unreachable(
        f"the asset folder cannot be used ({error.strerror or error})",
        where=str(root),
        hint="Make it writable for this user, free some space, or name another one in MAREY_STORE.",
        public=PUBLIC,
    )
