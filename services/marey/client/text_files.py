"""Text files of any origin, read in pieces: unpacked, decoded and bounded before their lines are parsed."""

from __future__ import annotations

import gzip
import io
import re
import stat
import sys
import zlib
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from marey.core.errors import InvalidFile, NotFound, TooLarge

GZIP_ENDING = ".gz"
GZIP_MAGIC = b"\x1f\x8b"
ZIP_MAGIC = b"PK\x03\x04"
UTF8_BOM = b"\xef\xbb\xbf"
UTF16_BOMS = (b"\xff\xfe", b"\xfe\xff")
ESCAPED_BYTE = re.compile("[\udc80-\udcff]")
"""A byte that is no UTF-8, as it is decoded: the lines before it can be read."""
MAX_LINE = 2**20
"""Characters of a line, far more than all fields of an item take."""
MAX_RATIO = 200
"""Unpacked over packed. Prompts pack to a tenth; lines that are all alike to a thousandth."""
RATIO_FROM = 4 * 2**20
"""Bytes unpacked from which the ratio counts: a short file may be all alike."""


@contextmanager
def open_text(path: str, *, limit: int) -> Generator[Iterator[str]]:
    """Open a file and iterate over its lines, with their ends (of Unix, Windows or old Macs); memory is bounded by a
    line.

    Args:
        path: a file, packed by gzip or not, or `-` for stdin.
        limit: bytes of text, unpacked.

    Raises:
        NotFound: there is no such file.
        InvalidFile: it cannot be read, or is no UTF-8, now or in the middle of reading.
        TooLarge: it is over the limit, one line of it is over `MAX_LINE`, or it unpacks to too much, likewise.
    """
    where = where_of(path)
    with _opened(path, limit) as raw:
        content = _Bounded(_unpacked(raw, where), raw, limit, where)
        text = io.TextIOWrapper(io.BufferedReader(content), encoding="utf-8", errors="surrogateescape", newline="")
        try:
            yield _lines(text, where)
        finally:
            text.detach()  # stdin stays open


def where_of(path: str) -> str:
    """Return the name of a file in messages."""
    return "stdin" if path == "-" else path


@contextmanager
def _opened(path: str, limit: int) -> Generator[_Counted]:
    if path == "-":
        yield _Counted(sys.stdin.buffer)
        return
    try:
        with Path(path).open("rb") as stream:
            status = Path(path).stat()
            if stat.S_ISREG(status.st_mode) and status.st_size > limit:  # packed or not: packing makes it no larger
                raise _too_large(limit, path)
            yield _Counted(stream)
    except FileNotFoundError:
        raise NotFound("there is no such file", where=path, hint="Check the path.") from None
    except OSError as error:
        raise InvalidFile(f"cannot be read: {error.strerror}", where=path) from error


class UnreadableLine(InvalidFile):
    """A line in the middle of a file that is no UTF-8."""

    def __init__(self, message: str, *, where: str, line: int, hint: str) -> None:
        super().__init__(message, where=f"{where}: line {line}", hint=hint)
        self.line = line


class _Counted(io.RawIOBase):
    """A stream whose first bytes can be inspected, and that counts the bytes that were read."""

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream
        self.head = stream.read(4)
        self._left = self.head
        self.taken = 0

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: memoryview, /) -> int:  # type: ignore[override]
        part = self._left[: len(buffer)] or self._stream.read(len(buffer))
        self._left = self._left[len(part) :]
        buffer[: len(part)] = part
        self.taken += len(part)
        return len(part)


def _unpacked(raw: _Counted, where: str) -> io.BufferedIOBase:
    if raw.head.startswith(GZIP_MAGIC):
        return gzip.GzipFile(fileobj=io.BufferedReader(raw), mode="rb")
    if where.lower().endswith(GZIP_ENDING):
        raise InvalidFile("is not packed by gzip, as its name says", where=where, hint="Rename it, or pack it anew.")
    if raw.head.startswith(ZIP_MAGIC):
        raise InvalidFile("is a ZIP archive or a workbook", where=where, hint="Save it as text: CSV UTF-8.")
    if raw.head.startswith(UTF16_BOMS):
        raise _utf16(where)
    return io.BufferedReader(raw)


class _Bounded(io.RawIOBase):
    """The text's bytes up to a limit, without the mark that some programs put before UTF-8."""

    def __init__(self, stream: io.BufferedIOBase, raw: _Counted, limit: int, where: str) -> None:
        self._stream = stream
        self._raw = raw
        self._limit = limit
        self._where = where
        self._size = 0

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: memoryview, /) -> int:  # type: ignore[override]
        part = self._read(len(buffer))
        if self._size == 0 and part:
            if part.startswith(UTF16_BOMS):
                raise _utf16(self._where)
            if part.startswith(UTF8_BOM):
                self._size = len(UTF8_BOM)
                part = part[len(UTF8_BOM) :] or self._read(len(buffer))
        self._size += len(part)
        if self._size > self._limit:
            raise _too_large(self._limit, self._where)
        if self._size > RATIO_FROM and self._size > MAX_RATIO * self._raw.taken:
            raise TooLarge(
                f"unpacks to more than {MAX_RATIO} times its size, which no file of prompts does",
                where=self._where,
                hint="If the file is correct, unpack it and submit the text.",
            )
        buffer[: len(part)] = part
        return len(part)

    def _read(self, size: int) -> bytes:
        try:
            return self._stream.read(size)
        except (EOFError, zlib.error, gzip.BadGzipFile) as error:
            raise InvalidFile(f"cannot be unpacked: {error}", where=self._where, hint="Pack it anew.") from error


def _lines(text: io.TextIOWrapper, where: str) -> Iterator[str]:
    number = 0
    while True:
        line = text.readline(MAX_LINE + 1)
        if not line:
            return
        number += 1
        if len(line) > MAX_LINE:
            raise TooLarge(
                f"is over {MAX_LINE:,} characters", where=f"{where}: line {number}", hint="Give one prompt a line."
            )
        wrong = None if line.isascii() else ESCAPED_BYTE.search(line)
        if wrong is not None:
            raise UnreadableLine(
                f"is not UTF-8 (byte 0x{ord(wrong.group()) - 0xDC00:02x})",
                where=where,
                line=number,
                hint="Save it as UTF-8 (in Excel: CSV UTF-8).",
            )
        yield line


def _utf16(where: str) -> InvalidFile:
    return InvalidFile("is UTF-16, not UTF-8", where=where, hint="Save it as UTF-8 (in Excel: CSV UTF-8).")


def _too_large(limit: int, where: str) -> TooLarge:
    return TooLarge(f"is over {limit // 2**20} MiB of text", where=where, hint="Submit it in parts.")
