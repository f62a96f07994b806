"""Messages between the API and the processes that make files: a JSON object and bytes, each after its length."""

from __future__ import annotations

import json
import struct
from typing import IO, Any

LENGTHS = struct.Struct("!QQ")


def write_message(stream: IO[bytes], header: dict[str, Any], content: bytes = b"") -> None:
    """Write a message.

    Raises:
        OSError: the reader has ended.
    """
    head = json.dumps(header).encode()
    for part in (LENGTHS.pack(len(head), len(content)), head, content):
        stream.write(part)
    stream.flush()


def read_message(stream: IO[bytes]) -> tuple[dict[str, Any], bytes]:
    """Read a message.

    Raises:
        EOFError: the writer has ended.
    """
    head, content = LENGTHS.unpack(_read(stream, LENGTHS.size))
    return json.loads(_read(stream, head)), _read(stream, content)


def _read(stream: IO[bytes], size: int) -> bytes:
    data = stream.read(size)
    if len(data) < size:
        raise EOFError
    return data
