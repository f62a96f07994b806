"""Read the rig of a glTF 2.0 file: .glb, .gltf, .vrm or .vrma.

The rest pose is that of the nodes. Everything that is needed stands in the JSON, so no buffer is read and no URI is
opened. Section numbers are those of the specification (Khronos Group, glTF 2.0, ISO/IEC 12113:2022).
"""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Iterable, Mapping, Sequence
from pathlib import PurePath
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from marey.core.documents import parse_json
from marey.core.errors import InvalidFile, TooLarge
from marey.motion.io.glb_write import JSON, MAGIC, VERSION
from marey.motion.rigs.make_rig import RigNode, check_count, make_rig
from marey.motion.rigs.rig import Rig
from marey.motion.rotations import normalize, to_matrix

MAX_NODES = 100_000
HUMANOIDS = ("VRMC_vrm", "VRMC_vrm_animation", "VRM")
"""Extensions that say which node is which part of the body: VRM 1.0, its animations, VRM 0."""


def parse_glb_rig(data: bytes, where: str = "glb") -> Rig:
    """Read the rig of a binary glTF file.

    Raises:
        InvalidFile: broken, or without a skeleton.
        TooLarge: over 2,000 joints.
    """
    if len(data) < 20 or data[:4] != MAGIC:
        raise InvalidFile("is not a glb file", where=where)
    version, length, size = struct.unpack_from("<III", data, 4)
    if version != VERSION:
        raise InvalidFile(f"is glTF {version}; only glTF {VERSION} is read", where=where)
    if data[16:20] != JSON or length > len(data) or 20 + size > length:
        raise InvalidFile("is cut off, or its chunks are broken", where=where)
    return _rig(data[20 : 20 + size], data, where)


def parse_gltf_rig(data: bytes, where: str = "gltf") -> Rig:
    """Read the rig of a glTF file in JSON; the files that it names are left alone. See `parse_glb_rig`."""
    return _rig(data, data, where)


def _rig(text: bytes, whole: bytes, where: str) -> Rig:
    document = parse_json(text, where)
    try:
        nodes, extras = _nodes(cast("Mapping[str, Any]", document), where)
    except (InvalidFile, TooLarge):
        raise
    except (ValueError, KeyError, IndexError, TypeError, AttributeError, OverflowError) as error:
        raise InvalidFile(f"its nodes cannot be read: {error}", where=where) from None
    return make_rig(
        nodes,
        name=PurePath(where).name,
        where=where,
        unit=1.0,
        up="y",
        source="glb",
        sha256=hashlib.sha256(whole).hexdigest(),
        extras=extras,
    )


def _nodes(document: Mapping[str, Any], where: str) -> tuple[list[RigNode], dict[str, Any]]:
    """Return the nodes of the skeleton, and what the file says of its parts of the body."""
    nodes: Sequence[Mapping[str, Any]] = document.get("nodes", [])
    if len(nodes) > MAX_NODES:
        raise InvalidFile(f"{len(nodes)} nodes, over the limit of {MAX_NODES}", where=where)
    parents = _parents(nodes, where)
    humanoid = _humanoid(document)
    bones = {int(joint) for skin in document.get("skins", []) for joint in skin["joints"]}
    bones = bones or set(humanoid.values()) or _without_bodies(nodes)
    if not all(0 <= bone < len(nodes) for bone in bones):
        raise InvalidFile("a skin names a node that is not there", where=where)
    kept = _with_relatives(bones, parents, nodes)
    check_count(len(kept), where)
    matrices = _global_matrices(kept, nodes, parents)
    place = {node: index for index, node in enumerate(kept)}
    found = [
        RigNode(
            str(nodes[n].get("name", f"node{n}")), place.get(parents[n], -1), matrices.get(n, np.eye(4)), n in bones
        )
        for n in kept
    ]
    return found, {"humanoid": {part: place[node] for part, node in humanoid.items() if node in place}}


def _parents(nodes: Sequence[Mapping[str, Any]], where: str) -> list[int]:
    """Return the parent of each node, -1 for a root (3.5.2: no node has two, and there is no circle)."""
    parents = [-1] * len(nodes)
    for index, node in enumerate(nodes):
        for child in node.get("children", []):
            if not 0 <= child < len(nodes) or parents[child] != -1 or child == index:
                raise InvalidFile(f"the node {child} has two parents, or is not there", where=where)
            parents[child] = index
    return parents


def _with_relatives(bones: Iterable[int], parents: Sequence[int], nodes: Sequence[Mapping[str, Any]]) -> list[int]:
    """Return the bones, the nodes above them, and those below them that carry no body, in the order of the file."""
    kept: set[int] = set()
    for bone in bones:
        above = bone
        while above >= 0 and above not in kept:
            kept.add(above)
            above = parents[above]
    waiting = list(bones)
    while waiting:
        below: list[int] = nodes[waiting.pop()].get("children", [])
        for child in below:
            if child not in kept and not _shows(nodes[child]):
                kept.add(child)
                waiting.append(child)
    return sorted(kept)


def _without_bodies(nodes: Sequence[Mapping[str, Any]]) -> set[int]:
    return {index for index, node in enumerate(nodes) if not _shows(node)}


def _shows(node: Mapping[str, Any]) -> bool:
    return "mesh" in node or "camera" in node


def _humanoid(document: Mapping[str, Any]) -> dict[str, int]:
    """Return the node of each part of the body that a VRM extension names."""
    extensions = document.get("extensions", {})
    for name in HUMANOIDS:
        bones = extensions.get(name, {}).get("humanoid", {})
        bones = bones.get("humanBones", bones)
        if isinstance(bones, list):  # VRM 0
            return {str(bone["bone"]): int(bone["node"]) for bone in cast("list[Any]", bones)}
        if bones:
            return {str(part): int(bone["node"]) for part, bone in bones.items()}
    return {}


def _global_matrices(
    kept: Sequence[int], nodes: Sequence[Mapping[str, Any]], parents: Sequence[int]
) -> dict[int, NDArray[np.float64]]:
    """Return the matrix of each node from its space to the file's, parents first; nodes of a circle are left out."""
    below: dict[int, list[int]] = {}
    for node in kept:
        below.setdefault(parents[node], []).append(node)
    matrices: dict[int, NDArray[np.float64]] = {-1: np.eye(4)}
    waiting = [-1]
    while waiting:
        above = waiting.pop()
        for node in below.get(above, []):
            with np.errstate(over="ignore", invalid="ignore"):  # `make_rig` refuses such numbers
                matrices[node] = matrices[above] @ _matrix(nodes[node])
            waiting.append(node)
    return matrices


def _matrix(node: Mapping[str, Any]) -> NDArray[np.float64]:
    """Return a node's own matrix (3.5.3)."""
    if "matrix" in node:
        return np.array(node["matrix"], np.float64).reshape(4, 4).T
    matrix = np.eye(4)
    x, y, z, w = (float(value) for value in node.get("rotation", (0, 0, 0, 1)))
    turn = to_matrix(normalize(np.array([w, x, y, z])))
    matrix[:3, :3] = turn * np.array(node.get("scale", (1, 1, 1)), np.float64)
    matrix[:3, 3] = np.array(node.get("translation", (0, 0, 0)), np.float64)
    return matrix
