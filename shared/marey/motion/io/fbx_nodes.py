"""Binary FBX files as a tree of nodes, as bytes.

The format is Autodesk's and not documented by it; layout and constants are those that the Blender Foundation described
(https://code.blender.org/2013/08/fbx-binary-file-format-specification/) and that assimp's exporter writes (BSD-3).
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
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


@dataclass(frozen=True, eq=False)
class FbxNode:
    """A node of a file.

    Attributes:
        name: its name, ASCII.
        properties: bool, int (32 bits), `Long`, float (64 bits), str, bytes or array.
        children: nodes below it.
        block: it may have children, so that an end of the list is written even if there are none.
    """

    name: str
    properties: tuple[Property, ...] = ()
    children: tuple[FbxNode, ...] = ()
    block: bool = field(default=False, repr=False)

    def first(self, name: str) -> FbxNode | None:
        """Return the first child of a name."""
        return next((child for child in self.children if child.name == name), None)


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
    """Append a node with all below it: its header holds the place where it ends."""
    name, start = each.name.encode("ascii"), len(data)
    properties = b"".join(_property(value) for value in each.properties)
    data += bytes(12) + bytes([len(name)]) + name + properties
    for child in each.children:
        _append(data, child)
    if each.children or each.block:
        data += bytes(13)
    struct.pack_into("<III", data, start, len(data), len(each.properties), len(properties))


def _property(value: Property) -> bytes:
    """Return the bytes of a property; arrays are not compressed, so that they do not depend on a version of zlib."""
    match value:
        case bool():
            return struct.pack("<c?", b"C", value)
        case Long():
            return struct.pack("<cq", b"L", value)
        case int():
            return struct.pack("<ci", b"I", value)
        case float():
            return struct.pack("<cd", b"D", value)
        case str():
            content = value.encode()
            return struct.pack("<cI", b"S", len(content)) + content
        case bytes():
            return struct.pack("<cI", b"R", len(value)) + value
        case _:
            letter = next(each for each, kind in ARRAYS.items() if np.dtype(kind) == value.dtype)
            content = np.ascontiguousarray(value, ARRAYS[letter]).tobytes()
            return struct.pack("<cIII", letter.encode(), value.size, 0, len(content)) + content
