"""Binary FBX files as a tree of nodes, as bytes.

The format is Autodesk's and not documented by it; layout and constants are those that the Blender Foundation described
(https://code.blender.org/2013/08/fbx-binary-file-format-specification/) and that assimp's exporter writes (BSD-3).
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

MAGIC = b"Kaydara FBX Binary  \0\x1a\0"
VERSION = 7400
TICKS = 46_186_158_000
"""Units of time in a second (KTime)."""
SEPARATOR = "\0\1"
"""Between the name and the class of an object in a binary file."""
ARRAYS = {"f": "<f4", "d": "<f8", "i": "<i4", "l": "<i8", "b": "u1"}
"""Types of array properties by their letter."""
CREATION_TIME = "1970-01-01 10:00:00:000"
FILE_ID = bytes.fromhex("28b32aebb624ccc2bfc8b02aa92bfcf1")
FOOTER_ID = bytes.fromhex("fabcab09d0c8d466b176fb831cf7267e")
"""Creation time, file identifier and footer depend on each other in a way that is not published; these three fit, and
other writers use them too."""
FOOTER_MAGIC = bytes.fromhex("f85a8c6adef5d97eece90ce3758f290b")


class Long(int):
    """A property of 64 bits; a plain int has 32."""


Property = bool | int | float | str | bytes | NDArray[Any]


@dataclass(eq=False, slots=True)
class FbxNode:
    """A node of a file. Not frozen: a file has thousands, and frozen ones take three times as long to make.

    Attributes:
        name: its name, ASCII.
        properties: bool, int (32 bits), `Long`, float (64 bits), str, bytes or array.
        children: nodes below it.
        block: it may have children, so that an end of the list is written even if there are none.
        content: its bytes after the place where it ends, once they are known: times and flags stand in hundreds of
            curves of a file, and what never changes in every file. A node is not changed after it is written.
    """

    name: str
    properties: tuple[Property, ...] = ()
    children: tuple[FbxNode, ...] = ()
    block: bool = field(default=False, repr=False)
    content: bytes | None = field(default=None, init=False, repr=False)


def node(
    name: str, *properties: Property, below: tuple[FbxNode, ...] | list[FbxNode] = (), block: bool = False
) -> FbxNode:
    """Return a node with these properties and children."""
    return FbxNode(name, properties, tuple(below), block)


def encode(top: list[FbxNode]) -> bytes:
    """Return the bytes of a file with these nodes at its top."""
    data = bytearray(MAGIC + struct.pack("<I", VERSION))
    for each in top:
        _append(data, each)
    data += bytes(13) + FOOTER_ID
    data += bytes(16 - len(data) % 16)
    data += bytes(4) + struct.pack("<I", VERSION) + bytes(120) + FOOTER_MAGIC
    return bytes(data)


def _append(data: bytearray, each: FbxNode) -> None:
    """Append a node with all below it: it begins with the place where it ends."""
    start = len(data)
    data += bytes(4)
    data += _content(each)
    for child in each.children:
        if child.children or child.block:
            _append(data, child)
            continue
        content = child.content
        if content is None:
            content = child.content = _content(child)
        data += _LENGTH.pack(len(data) + 4 + len(content))
        data += content
    if each.children or each.block:
        data += bytes(13)
    _LENGTH.pack_into(data, start, len(data))


def _content(each: FbxNode) -> bytes:
    """Return the bytes of a node after the place where it ends, without those of its children."""
    name, properties = _ascii(each.name), b"".join([_ENCODERS[type(value)](value) for value in each.properties])
    return _COUNTS.pack(len(each.properties), len(properties), len(name)) + name + properties


_LENGTH, _COUNTS, _COUNTED, _ARRAY = (struct.Struct(each) for each in ("<I", "<IIB", "<cI", "<cIII"))
_LONG, _INT, _FLOAT, _BOOL = (struct.Struct(each) for each in ("<cq", "<ci", "<cd", "<c?"))
_LETTERS = {np.dtype(kind): letter.encode() for letter, kind in ARRAYS.items()}


@lru_cache(maxsize=4096)
def _ascii(name: str) -> bytes:
    return name.encode("ascii")


@lru_cache(maxsize=4096)
def _text(value: str) -> bytes:
    content = value.encode()
    return _COUNTED.pack(b"S", len(content)) + content


def _array(value: NDArray[Any]) -> bytes:
    """Return the bytes of an array; it is not compressed, so that they do not depend on a version of zlib."""
    content = value.tobytes()
    return _ARRAY.pack(_LETTERS[value.dtype], value.size, 0, len(content)) + content


_ENCODERS: dict[type, Callable[[Any], bytes]] = {
    bool: lambda value: _BOOL.pack(b"C", value),
    Long: lambda value: _LONG.pack(b"L", value),
    int: lambda value: _INT.pack(b"I", value),
    float: lambda value: _FLOAT.pack(b"D", value),
    str: _text,
    bytes: lambda value: _COUNTED.pack(b"R", len(value)) + value,
    np.ndarray: _array,
}
"""Bytes of a property by its type."""
