"""The interface of asset stores. Keys are `t/{tenant}/{sha[:2]}/{sha}`; content never changes under a key."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO, Protocol, runtime_checkable

from marey.core.errors import InvalidInput, NotFound

CHUNK = 1 << 20
PRESIGN_SECONDS = 900
PUBLIC = "the asset store does not answer"
"""Message for API clients when the store is down, without its address."""
KEY = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]*(/[A-Za-z0-9][A-Za-z0-9._-]*)*")


@dataclass(frozen=True)
class Digest:
    """SHA-256 of content in hex, and its size in bytes."""

    sha256: str
    size: int


@dataclass(frozen=True)
class Opened:
    """An open object: `size` is that of the whole object, `chunks` yields the requested range.

    Read `chunks` to its end or `close()` it: an S3 store holds a connection until then.
    """

    size: int
    chunks: Iterator[bytes]

    def close(self) -> None:
        """Close the connection or file."""
        close = getattr(self.chunks, "close", None)
        if close is not None:
            close()


@dataclass(frozen=True)
class NewObject:
    """Content to store under a key."""

    key: str
    content: bytes = field(repr=False)
    media_type: str = "application/octet-stream"


@runtime_checkable
class AssetStore(Protocol):
    """A store of immutable objects. Safe to use from several threads.

    Every method raises `Unreachable`, within bounded time, when the store does not answer or refuses the
    credentials; `InvalidInput` for an invalid key.
    """

    def prepare(self) -> None:
        """Create the store's folder or bucket and remove leftovers of killed writers. Idempotent."""
        ...

    def put(self, key: str, source: bytes | Path, *, media_type: str = "application/octet-stream") -> Digest:
        """Store bytes, or the content of a file, under `key`, atomically.

        Raises:
            InvalidInput: the last part of `key` is a SHA-256 of other content.
        """
        ...

    def put_all(self, objects: Sequence[NewObject]) -> Iterator[str]:
        """Store a batch, faster than single `put` calls; yield the keys that are stored durably.

        Lazy: iterate to store. After an error, as of `put`, repeat the objects that were not yielded.
        """
        ...

    def get(self, key: str) -> bytes:
        """Return the whole content.

        Raises:
            NotFound: no such object.
        """
        ...

    def open(self, key: str, start: int = 0, length: int | None = None) -> Opened:
        """Open content from byte `start`, `length` bytes (None = to the end; past the end: the available rest), in
        chunks.

        Raises:
            NotFound: no such object.
            InvalidInput: the range begins past the end of the object.
        """
        ...

    def exists(self, key: str) -> bool:
        """Return True if there is such an object."""
        ...

    def size(self, key: str) -> int:
        """Return the size of an object in bytes.

        Raises:
            NotFound: no such object.
        """
        ...

    def delete(self, key: str) -> None:
        """Delete an object; a missing one is no error."""
        ...

    def keys(self, prefix: str = "") -> Iterator[str]:
        """Yield the keys that begin with `prefix`, in order."""
        ...

    def presign(self, key: str, *, filename: str, media_type: str, seconds: int = PRESIGN_SECONDS) -> str | None:
        """Return a URL that gives access to the object for `seconds`, as a download named `filename`.

        None if the store has no URLs (a folder): send the content then.
        """
        ...

    def check(self) -> None:
        """Check that the store accepts objects now; for /readyz and doctor.

        Raises:
            Unreachable: it does not.
        """
        ...


def asset_digest(source: bytes | Path) -> Digest:
    """Return SHA-256 and size of bytes or of a file, in constant memory."""
    if isinstance(source, bytes):
        return Digest(hashlib.sha256(source).hexdigest(), len(source))
    with source.open("rb") as file:
        return Digest(hashlib.file_digest(file, "sha256").hexdigest(), file.tell())


def checked_key(key: str) -> str:
    """Validate `key` and return it: parts of letters, digits and `._-`, none beginning with a dot.

    Raises:
        InvalidInput: an invalid key (an absolute path, `..`, a backslash, NUL, …).
    """
    if not KEY.fullmatch(key) or len(key) > 512:
        raise InvalidInput(f"{key[:80]!r} is not a key of the asset store", where="key")
    return key


def check_content(key: str, digest: Digest) -> None:
    """Validate that content matches its key.

    Raises:
        InvalidInput: the last part of `key` is the SHA-256 of other content.
    """
    named = key.rpartition("/")[2]
    if re.fullmatch(r"[0-9a-f]{64}", named) and named != digest.sha256:
        raise InvalidInput(f"the content has SHA-256 {digest.sha256}, its key says {named}", where=key)


def no_such_object(key: str) -> NotFound:
    """Return the error for a key without an object."""
    return NotFound("no such object in the asset store", where=key)


def range_past_end(key: str, start: int, size: int) -> InvalidInput:
    """Return the error for a range that begins past the end."""
    return InvalidInput(f"the range begins at byte {start} of {size}", where=key)


def read_chunks(file: BinaryIO, length: int) -> Iterator[bytes]:
    """Yield the next `length` bytes of an open file in chunks; the file is closed at the end.

    No read requests more than is left: its buffer is allocated before the first byte arrives, and most files are a
    hundredth of a chunk.
    """
    with file:
        left = length
        while left > 0 and (chunk := file.read(min(CHUNK, left))):
            left -= len(chunk)
            yield chunk
