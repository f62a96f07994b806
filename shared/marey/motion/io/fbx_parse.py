"""Read the nodes of a binary FBX file, versions 7.1 to 7.7. Sizes and counts are checked before anything is read.

Files may be hostile: work is bounded by `MAX_ITEMS` and `MAX_UNPACKED`, recursion by `MAX_DEPTH`, and meshes, which are
most of a file, are skipped by their size.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from marey.core.errors import InvalidFile, TooLarge
from marey.motion.io.fbx_nodes import ARRAYS, MAGIC

OLDEST, NEWEST, WIDE = 7100, 7799, 7500
"""Versions that are read; from the last one on, sizes have 64 bits."""
MAX_ITEMS, NODE = 1_500_000, 4
"""Properties of a file and its nodes, which count four times. 2,000 animated joints take about 1,300,000."""
MAX_UNPACKED = 64 * 2**20  # bytes of all arrays that are read
MAX_DEPTH = 32
NUMBERS = {"Y": "<h", "C": "<?", "I": "<i", "F": "<f", "D": "<d", "L": "<q"}
_NUMBERS = {ord(letter): struct.Struct(form) for letter, form in NUMBERS.items()}
_SIZE, _ARRAY = struct.Struct("<I"), struct.Struct("<III")
SKIPPED = frozenset(
    {"Geometry", "Video", "Texture", "Material", "Implementation", "BindingTable", "Shape", "Thumbnail"}
)
ASCII = "Export it as binary FBX (7.4 or 7.5), which every program that writes FBX offers."


@dataclass(frozen=True, eq=False)
class Packed:
    """An array property, not yet read.

    Attributes:
        letter: its type, a key of `ARRAYS`.
        count: numbers that it claims to hold.
        compressed: its content is packed by zlib.
        content: the bytes in the file.
    """

    letter: str
    count: int
    compressed: bool
    content: memoryview = field(repr=False)


Value = bool | int | float | bytes | Packed


@dataclass(eq=False, slots=True)
class ReadNode:
    """A node of a file: its name, properties (texts are bytes) and children."""

    name: str
    properties: list[Value]
    children: list[ReadNode]

    def first(self, name: str) -> ReadNode | None:
        """Return the first child of a name."""
        return next((child for child in self.children if child.name == name), None)

    def all(self, name: str) -> list[ReadNode]:
        """Return the children of a name."""
        return [child for child in self.children if child.name == name]


class FbxFile:
    """The nodes of a file.

    Args:
        data: its bytes.
        where: names it in errors.

    Raises:
        InvalidFile: ASCII, another version, broken or cut off.
        TooLarge: more nodes than any rig has.
    """

    def __init__(self, data: bytes, where: str) -> None:
        self.where = where
        self._data, self._items, self._unpacked = data, 0, 0
        self.version = self._version()
        self._header = struct.Struct("<QQQB" if self.version >= WIDE else "<IIIB")
        at, self.top = len(MAGIC) + 4, list[ReadNode]()
        try:
            while (found := self._node(at, len(data), 0)) is not None:
                at, node = found
                self.top.append(node)
        except (struct.error, IndexError, UnicodeDecodeError) as error:
            raise self.broken(f"is cut off, or broken: {error}") from None

    def first(self, name: str) -> ReadNode:
        """Return the first top node of a name; an empty one if there is none."""
        return next((node for node in self.top if node.name == name), ReadNode(name, [], []))

    def array(self, node: ReadNode | None, letters: str, *, most: int) -> NDArray[Any]:
        """Return the numbers of a node's first property, empty without a node.

        Args:
            letters: types that are expected, such as `fd`.
            most: numbers that it may hold.

        Raises:
            InvalidFile: another type, or another count than the file claims.
            TooLarge: more than `most`, or all arrays together over 64 MiB.
        """
        packed = node.properties[0] if node is not None and node.properties else None
        if packed is None:
            return np.zeros(0)
        if not isinstance(packed, Packed) or packed.letter not in letters:
            raise self.broken(f"{node.name if node else ''} is not an array of the type {letters}")
        kind = np.dtype(ARRAYS[packed.letter])
        size = packed.count * kind.itemsize
        self._unpacked += size
        if packed.count > most or self._unpacked > MAX_UNPACKED:
            raise TooLarge(f"an array of {packed.count} numbers, over the limit", where=self.where)
        content: bytes | memoryview = packed.content
        if packed.compressed:
            try:
                content = zlib.decompressobj().decompress(content, size + 1)
            except zlib.error as error:
                raise self.broken(f"an array cannot be unpacked: {error}") from None
        if len(content) != size:
            raise self.broken(f"an array holds {len(content)} bytes, not {size}")
        return np.frombuffer(content, kind)

    def broken(self, message: str) -> InvalidFile:
        """Return an error about this file."""
        return InvalidFile(message, where=self.where)

    def _version(self) -> int:
        if self._data[: len(MAGIC)] != MAGIC:
            if self._data[:200].lstrip()[:1] == b";" or b"FBXHeaderExtension" in self._data[:2000]:
                raise InvalidFile("is an ASCII FBX file; only binary ones are read", where=self.where, hint=ASCII)
            raise self.broken("is not an FBX file")
        if len(self._data) < len(MAGIC) + 4:
            raise self.broken("is cut off")
        (version,) = _SIZE.unpack_from(self._data, len(MAGIC))
        if not OLDEST <= version <= NEWEST:
            message = f"is FBX {version / 1000:.1f}; versions 7.1 to 7.7 are read"
            raise InvalidFile(message, where=self.where, hint=ASCII)
        return version

    def _count(self, items: int) -> None:
        self._items += items
        if self._items > MAX_ITEMS:
            raise TooLarge("more nodes and properties than any rig has", where=self.where)

    def _node(self, at: int, limit: int, depth: int) -> tuple[int, ReadNode] | None:
        """Return where the node at a place ends, and the node; None at the end of a list."""
        end, count, size, length = self._header.unpack_from(self._data, at)
        if end == 0:
            return None
        start = at + self._header.size + length
        name = self._data[at + self._header.size : start].decode("ascii")
        if not start + size <= end <= limit:
            raise self.broken(f"the node {name!r} at byte {at} ends beyond the file or its parent")
        if depth > MAX_DEPTH:
            raise self.broken(f"nodes are nested more than {MAX_DEPTH} deep")
        self._count(NODE + min(count, size))
        node = ReadNode(name, [], [])
        if name in SKIPPED:
            return end, node
        at = start
        for _ in range(count):
            at = self._property(at, start + size, node.properties)
        at = start + size
        while at < end:
            found = self._node(at, end, depth + 1)
            if found is None:
                break
            at, child = found
            node.children.append(child)
        return end, node

    def _property(self, at: int, limit: int, into: list[Value]) -> int:
        """Read the property at a place and return where it ends."""
        data, letter = self._data, self._data[at]
        if (number := _NUMBERS.get(letter)) is not None:
            into.append(number.unpack_from(data, at + 1)[0])
            end = at + 1 + number.size
        elif letter in b"SR":
            (size,) = _SIZE.unpack_from(data, at + 1)
            end = at + 5 + size
            into.append(data[at + 5 : end])
        elif chr(letter) in ARRAYS:
            count, encoding, size = _ARRAY.unpack_from(data, at + 1)
            end = at + 13 + size
            if end <= limit:
                into.append(Packed(chr(letter), count, encoding == 1, memoryview(data)[at + 13 : end]))
        else:
            raise self.broken(f"a property at byte {at} has the unknown type {chr(letter)!r}")
        if end > limit:
            raise self.broken(f"a property at byte {at} ends beyond its node")
        return end


def text(value: Value) -> str:
    """Return a text property; other types as an empty text."""
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else ""


def number(value: Value) -> float:
    """Return a number property; other types as 0."""
    return float(value) if isinstance(value, bool | int | float) else 0.0


def identifier(value: Value) -> int:
    """Return a property that identifies an object; other types as 0."""
    return int(value) if isinstance(value, bool | int) else 0
