"""The `Range` header (RFC 9110, section 14)."""

from __future__ import annotations

import re
from dataclasses import dataclass

SINGLE = re.compile(r"bytes=(\d{0,18})-(\d{0,18})", re.ASCII)


@dataclass(frozen=True)
class ByteRange:
    """Bytes `start` … `start + length - 1`; `start` may lie past the end of the file."""

    start: int
    length: int


def parse_range(header: str | None, size: int) -> ByteRange | None:
    """Parse one range of a file of `size` bytes; None = send the whole file (no header, several ranges, or an invalid
    one, which the RFC allows to ignore)."""
    match = SINGLE.fullmatch(header.strip()) if header else None
    if match is None or match[0] == "bytes=-":
        return None
    first, last = match[1], match[2]
    if not first:
        length = min(int(last), size)
        return ByteRange(size - length, length) if length else ByteRange(size, 0)
    start = int(first)
    end = min(int(last), size - 1) if last else size - 1
    if last and int(last) < start:
        return None
    return ByteRange(start, max(end - start + 1, 0))
