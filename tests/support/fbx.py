"""FBX files of any version, made for tests: the nodes of another file, or of models given by their properties."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping, Sequence

import numpy as np

from marey.motion.io.fbx_nodes import MAGIC, FbxNode, Long, node
from marey.motion.io.fbx_parse import FbxFile, Packed, ReadNode

LETTERS = {"<f4": "f", "<f8": "d", "<i4": "i", "<i8": "l"}


def encode_nodes(top: Sequence[FbxNode], version: int = 7400, *, packed: bool = False) -> bytes:
    """Return the bytes of a file; `packed` arrays are compressed."""
    data = bytearray(MAGIC + struct.pack("<I", version))
    for each in top:
        _append(data, each, version, packed)
    return bytes(data) + bytes(25 if version >= 7500 else 13)


def _append(data: bytearray, each: FbxNode, version: int, packed: bool) -> None:
    form = "<QQQB" if version >= 7500 else "<IIIB"
    start, content = len(data), b"".join(_property(value, packed) for value in each.properties)
    name = each.name.encode()
    data += bytes(struct.calcsize(form)) + name + content
    for child in each.children:
        _append(data, child, version, packed)
    if each.children:
        data += bytes(struct.calcsize(form))
    struct.pack_into(form, data, start, len(data), len(each.properties), len(content), len(name))


def _property(value: object, packed: bool) -> bytes:
    if isinstance(value, np.ndarray):
        content = value.tobytes()
        stored = zlib.compress(content) if packed else content
        letter = LETTERS[value.dtype.str].encode()
        return struct.pack("<cIII", letter, value.size, int(packed), len(stored)) + stored
    if isinstance(value, str | bytes):
        content = value.encode() if isinstance(value, str) else value
        return struct.pack("<cI", b"S", len(content)) + content
    if isinstance(value, float):
        return struct.pack("<cd", b"D", value)
    if isinstance(value, bool) or not isinstance(value, int):
        return struct.pack("<c?", b"C", bool(value))
    return struct.pack("<cq", b"L", value) if isinstance(value, Long) else struct.pack("<ci", b"I", value)


def rewritten(data: bytes, version: int, *, packed: bool = False) -> bytes:
    """Return a file in another version."""
    file = FbxFile(data, "rewritten")
    return encode_nodes([_again(file, each) for each in file.top], version, packed=packed)


def extended(data: bytes, objects: Sequence[FbxNode], links: Sequence[FbxNode] = ()) -> bytes:
    """Return a file with more objects, and more connections."""
    file = FbxFile(data, "extended")
    more = {"Objects": objects, "Connections": links}
    nodes = [_again(file, each) for each in file.top]
    return encode_nodes([node(n.name, *n.properties, below=[*n.children, *more.get(n.name, ())]) for n in nodes])


def _again(file: FbxFile, each: ReadNode) -> FbxNode:
    values = [file.array(each, "fdilb", most=2**20) if isinstance(v, Packed) else v for v in each.properties]
    large = [Long(v) if isinstance(v, int) and not isinstance(v, bool) and abs(v) >= 2**31 else v for v in values]
    return node(each.name, *large, below=[_again(file, child) for child in each.children])


def scene_file(
    models: Sequence[tuple[str, int, Mapping[str, Sequence[float]]]],
    settings: Mapping[str, float] | None = None,
    version: int = 7400,
) -> bytes:
    """Return a file of limbs.

    Args:
        models: name, index of the parent (-1 = the scene) and properties of each.
        settings: such as `UpAxis`.
    """

    def row(name: str, values: Sequence[float]) -> FbxNode:
        return node("P", name, "Vector3D", "Vector", "", *(v if isinstance(v, int) else float(v) for v in values))

    def rows(properties: Mapping[str, Sequence[float]]) -> FbxNode:
        return node("Properties70", below=[row(*each) for each in properties.items()])

    objects: list[FbxNode] = []
    links: list[FbxNode] = []
    for index, (name, parent, properties) in enumerate(models):
        number, attribute = Long(1000 + index), Long(5000 + index)
        objects.append(node("Model", number, f"{name}\0\1Model", "LimbNode", below=[rows(properties)]))
        flags = node("TypeFlags", "Skeleton")
        objects.append(node("NodeAttribute", attribute, "\0\1NodeAttribute", "LimbNode", below=[flags]))
        links += [
            node("C", "OO", number, Long(1000 + parent if parent >= 0 else 0)),
            node("C", "OO", attribute, number),
        ]
    stated = rows({name: (value,) for name, value in (settings or {}).items()})
    return encode_nodes(
        [
            node("FBXHeaderExtension", below=[node("FBXVersion", version)]),
            node("GlobalSettings", below=[node("Version", 1000), stated]),
            node("Objects", below=objects),
            node("Connections", below=links),
        ],
        version,
    )
