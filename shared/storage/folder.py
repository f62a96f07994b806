"""The asset store in a folder: temporary file, fsync, rename."""

from __future__ import annotations

import io
import os
import shutil
import tempfile
import time
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from pathlib import Path

from shared.errors import Unreachable
from shared.storage.port import (
    PRESIGN_SECONDS,
    Digest,
    Opened,
    asset_digest,
    check_content,
    checked_key,
    no_such_object,
    range_past_end,
    read_chunks,
)

ABANDONED_SECONDS = 3600.0  # no writer takes so long
INCOMING = ".incoming"
"""Folder of files being written; its name is no key's, so listings never show it."""


class FolderStore:
    """Objects are files under `root`, named by their keys."""

    def __init__(self, root: Path) -> None:
        self.root = root.absolute()

    def prepare(self) -> None:
        """See `AssetStore.prepare`."""
        with _outages(self.root):
            incoming = self.root / INCOMING
            incoming.mkdir(parents=True, exist_ok=True)
            for left in incoming.iterdir():
                if left.stat().st_mtime < time.time() - ABANDONED_SECONDS:
                    left.unlink(missing_ok=True)

    def put(self, key: str, source: bytes | Path, *, media_type: str = "application/octet-stream") -> Digest:
        """See `AssetStore.put`. The media type is the caller's to keep."""
        path = self.path(key)
        with io.BytesIO(source) if isinstance(source, bytes) else source.open("rb") as content, _outages(self.root):
            incoming = self.root / INCOMING
            incoming.mkdir(parents=True, exist_ok=True)
            descriptor, name = tempfile.mkstemp(dir=incoming)
            temporary = Path(name)
            try:
                with os.fdopen(descriptor, "wb") as file:
                    shutil.copyfileobj(content, file)
                    file.flush()
                    os.fsync(file.fileno())
                digest = asset_digest(temporary)  # of what was written, not of what was meant
                check_content(key, digest)
                path.parent.mkdir(parents=True, exist_ok=True)
                temporary.replace(path)
                _fsync_folder(path.parent)
            finally:
                temporary.unlink(missing_ok=True)
        return digest

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
        return Opened(size, read_chunks(file, length))

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
        """None: a folder has no URLs."""
        checked_key(key)

    def check(self) -> None:
        """See `AssetStore.check`."""
        with _outages(self.root):
            incoming = self.root / INCOMING
            incoming.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=incoming) as file:
                file.write(b"marey")

    def path(self, key: str) -> Path:
        """The file of a key: always inside the folder, for `checked_key` lets no part begin with a dot."""
        return self.root / checked_key(key)


def _keys_of(root: Path, folder: str, folders: list[str], files: list[str]) -> Iterator[str]:
    if INCOMING in folders:
        folders.remove(INCOMING)
    relative = Path(folder).relative_to(root)
    for name in files:
        yield (relative / name).as_posix()


def _raise(error: OSError) -> None:
    if not isinstance(error, FileNotFoundError):  # a folder not made yet holds nothing
        raise error


def _fsync_folder(folder: Path) -> None:
    """Make a rename durable; some file systems refuse to open folders (Windows), and need it not."""
    if os.name == "nt":
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


@contextmanager
def _outages(root: Path, key: str | None = None) -> Generator[None]:
    """Turn errors of the file system into `NotFound` (of `key`) or `Unreachable`."""
    try:
        yield
    except (FileNotFoundError, NotADirectoryError, IsADirectoryError) as error:
        if key is None:
            raise _unreachable(root, error) from error
        raise no_such_object(key) from error
    except OSError as error:
        raise _unreachable(root, error) from error


def _unreachable(root: Path, error: OSError) -> Unreachable:
    return Unreachable(
        f"the asset folder cannot be used ({error.strerror or error})",
        where=str(root),
        hint="Make it writable for this user, free some space, or name another one in MAREY_STORE.",
    )
