"""Write glb files: glTF 2.0 in its binary form, a JSON chunk and a chunk of little-endian numbers.

Section numbers are those of the specification (Khronos Group, glTF 2.0, ISO/IEC 12113:2022). Metres, Y up and +Z
forward are the format's own; a file holds the skeleton as nodes with a skin, one animation, and on request a mesh.
"""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from marey.core.errors import InvalidInput
from marey.motion.arrange import Arranged, Posed, arrange
from marey.motion.export_options import PLAIN, ExportOptions, InPlace, Placement
from marey.motion.files import write_atomically
from marey.motion.io.mesh import Mesh
from marey.motion.rotations import unroll

GENERATOR = "Marey"
MAGIC, VERSION = b"glTF", 2
JSON, BIN = b"JSON", b"BIN\0"
FLOAT, UNSIGNED_SHORT = 5126, 5123  # componentTypes (3.6.2.2)
DTYPES = {FLOAT: "<f4", UNSIGNED_SHORT: "<u2"}
VERTICES, INDICES = 34962, 34963  # targets of bufferViews
FEET = ("L_ankle", "L_toe", "R_ankle", "R_toe")
"""Names of the columns of `MotionClip.contacts`."""


def write_glb(
    path: Path | str,
    clip: Posed,
    *,
    root_bone: bool = False,
    in_place: InPlace | None = None,
    tpose_frame: bool = False,
    placement: Placement = "origin",
) -> None:
    """Write a clip as glb, atomically: the skeleton in its T-pose, a skin, and the motion.

    Args:
        path: the file.
        clip: a MotionClip, whose manifest becomes `asset.extras`, or a BvhClip.
        root_bone, in_place, tpose_frame, placement: see `ExportOptions`.

    Raises:
        InvalidInput: options that contradict each other, bones that change their length, or numbers that are not
            finite.
    """
    options = ExportOptions(root_bone=root_bone, in_place=in_place, tpose_frame=tpose_frame, placement=placement)
    write_atomically(Path(path), format_glb(clip, options))


def format_glb(clip: Posed, options: ExportOptions = PLAIN, mesh: Mesh | None = None) -> bytes:
    """Return the bytes of the glb file; equal clips give equal bytes. See `write_glb`.

    Args:
        mesh: a body of the clip's skeleton.
    """
    posed = arrange(clip, options)
    if not (np.isfinite(posed.rotations).all() and np.isfinite(posed.positions).all()):
        raise InvalidInput("the clip holds NaN or infinite numbers", where=posed.skeleton.name)
    numbers = Numbers()
    count = len(posed.skeleton)
    body = {} if mesh is None else _body(mesh, posed, count - len(clip.skeleton), numbers)
    shown = [{"name": "body", "mesh": 0, "skin": 0}] if body else []
    document: dict[str, Any] = {
        **body,
        "asset": {"version": "2.0", "generator": GENERATOR, "extras": _extras(clip, posed, options)},
        "scene": 0,
        "scenes": [{"nodes": [0, count] if shown else [0]}],
        "nodes": [*joint_nodes(posed), *shown],
        "skins": [_skin(posed, numbers)],
        "animations": [animation_of(posed, numbers)],
        "accessors": numbers.accessors,
        "bufferViews": numbers.views,
        "buffers": [{"byteLength": len(numbers.data)}],
    }
    return pack(document, numbers)


def pack(document: Mapping[str, Any], numbers: Numbers) -> bytes:
    """Return the bytes of a file with this JSON and these numbers (4.4)."""
    text = json.dumps(document, ensure_ascii=False, allow_nan=False, separators=(",", ":"), sort_keys=True)
    chunks = _chunk(JSON, text.encode(), b" ") + _chunk(BIN, bytes(numbers.data), b"\0")
    return struct.pack("<4sII", MAGIC, VERSION, 12 + len(chunks)) + chunks


class Numbers:
    """The buffer of a file and the accessors into it."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.views: list[dict[str, int]] = []
        self.accessors: list[dict[str, Any]] = []

    def add(
        self,
        kind: str,
        values: NDArray[Any],
        *,
        component: int = FLOAT,
        target: int | None = None,
        **bounds: Sequence[float],
    ) -> int:
        """Append values and return the number of their accessor.

        Args:
            kind: the element's type, such as `VEC3`.
            values: (N, ...) one row an element.
            component: type of the numbers, `FLOAT` or `UNSIGNED_SHORT`.
            target: use of the numbers in a mesh, `VERTICES` or `INDICES`.
            bounds: `min` and `max`, where the format asks for them.
        """
        content = np.ascontiguousarray(values, DTYPES[component]).tobytes()
        use = {} if target is None else {"target": target}
        self.views.append({"buffer": 0, "byteOffset": len(self.data), "byteLength": len(content), **use})
        self.data += content + b"\0" * (-len(content) % 4)
        accessor = {"bufferView": len(self.views) - 1, "componentType": component, "count": len(values), "type": kind}
        self.accessors.append({**accessor, **bounds})
        return len(self.accessors) - 1


def joint_nodes(posed: Arranged) -> list[dict[str, Any]]:
    """Return a node a joint, in the skeleton's order; none is turned at rest."""
    tree = posed.skeleton
    nodes: list[dict[str, Any]] = []
    for name, offset, children in zip(tree.joint_names, tree.offsets, tree.children, strict=True):
        node: dict[str, Any] = {"name": name, "translation": floats(offset)}
        nodes.append({**node, "children": list(children)} if children else node)
    return nodes


def _skin(posed: Arranged, numbers: Numbers) -> dict[str, Any]:
    """Return the skin, by which programs know that the nodes are bones (3.7.3). It is there without a mesh too: Blender
    makes empties of nodes without one."""
    matrices = np.tile(np.eye(4, dtype=np.float32), (len(posed.skeleton), 1, 1))
    matrices[:, 3, :3] = -posed.skeleton.rest  # column-major: the last column lies in the last row
    inverse = numbers.add("MAT4", matrices)
    return {"inverseBindMatrices": inverse, "joints": list(range(len(posed.skeleton))), "skeleton": 0}


def _body(mesh: Mesh, posed: Arranged, added: int, numbers: Numbers) -> dict[str, Any]:
    """Return meshes and materials (3.7.2, 3.9).

    Args:
        added: joints before those of the clip: a root bone.
    """
    carriers = mesh.joints + added
    points = (mesh.points + posed.skeleton.rest[carriers]).astype(np.float32)
    joints, weights = np.zeros((len(points), 4), np.uint16), np.zeros((len(points), 4), np.float32)
    joints[:, 0], weights[:, 0] = carriers, 1
    low, high = floats(points.min(axis=0)), floats(points.max(axis=0))
    attributes = {
        "POSITION": numbers.add("VEC3", points, target=VERTICES, min=low, max=high),
        "NORMAL": numbers.add("VEC3", mesh.normals, target=VERTICES),
        "JOINTS_0": numbers.add("VEC4", joints, component=UNSIGNED_SHORT, target=VERTICES),
        "WEIGHTS_0": numbers.add("VEC4", weights, target=VERTICES),
    }
    indices = numbers.add("SCALAR", mesh.triangles.reshape(-1), component=UNSIGNED_SHORT, target=INDICES)
    surface = {"baseColorFactor": [*mesh.colour, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.9}
    return {
        "meshes": [{"name": "body", "primitives": [{"attributes": attributes, "indices": indices, "material": 0}]}],
        "materials": [{"name": "body", "pbrMetallicRoughness": surface}],
    }


def animation_of(posed: Arranged, numbers: Numbers) -> dict[str, Any]:
    """Return the animation: a rotation a joint, and positions of those that move (3.11)."""
    times = np.arange(len(posed.rotations)) / posed.fps
    ends = times.astype(np.float32)[[0, -1], None].tolist()
    time = numbers.add("SCALAR", times, min=ends[0], max=ends[1])
    turns = unroll(posed.rotations)[..., [1, 2, 3, 0]]  # x y z w
    tracks = [(joint, "rotation", "VEC4", turns[:, joint]) for joint in range(turns.shape[1])]
    places = posed.positions
    tracks += [(joint, "translation", "VEC3", places[:, joint]) for joint in range(places.shape[1])]
    return animation_with(tracks, time, numbers)


def animation_with(tracks: Iterable[tuple[int, str, str, NDArray[Any]]], time: int, numbers: Numbers) -> dict[str, Any]:
    """Return an animation with a channel for each track.

    Args:
        tracks: node, what is moved of it, type of the accessor, and values (T, 3 or 4).
        time: accessor of the times of all tracks.
        numbers: where the values go.
    """
    channels: list[dict[str, Any]] = []
    samplers: list[dict[str, Any]] = []
    for joint, path, kind, values in tracks:
        channels.append({"sampler": len(samplers), "target": {"node": joint, "path": path}})
        samplers.append({"input": time, "interpolation": "LINEAR", "output": numbers.add(kind, values)})
    return {"name": "motion", "channels": channels, "samplers": samplers}


def _extras(clip: Posed, posed: Arranged, options: ExportOptions) -> dict[str, Any]:
    """Return what the format has no place for, of programs that want it: the exact rate, contacts, options, manifest.

    In `asset`, importers leave it alone: Blender would refuse some of it as properties of an object.
    """
    first = int(options.tpose_frame)
    contacts: NDArray[np.bool_] | None = getattr(clip, "contacts", None)
    stands = {} if contacts is None else dict(zip(FEET, contacts.T, strict=True))
    return {
        "fps": float(posed.fps),
        "contacts": {foot: spans(column, first) for foot, column in stands.items()},
        "options": chosen_options(options),
        **posed.removed,
        "manifest": plain(getattr(clip, "manifest", {})),
    }


def chosen_options(options: ExportOptions) -> dict[str, Any]:
    """Return the options that a file was written with, for its readers; a rig stands in the manifest, not as a path."""
    return {name: value for name, value in options.values.items() if name not in ("bvh_root", "rig", "rig_map")}


def spans(stands: NDArray[np.bool_], first: int) -> list[list[int]]:
    """Return the stretches of True as [begin, end) in frames of the file, whose motion begins in frame `first`."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], stands, [False]]).astype(np.int8))) + first
    return edges.reshape(-1, 2).tolist()


def plain(value: Any) -> Any:
    """Return JSON without NaN and infinite numbers, which the format forbids (2.7); null stands in their place."""
    if isinstance(value, Mapping):
        return {str(name): plain(each) for name, each in cast("Mapping[Any, Any]", value).items()}
    if isinstance(value, list | tuple):
        return [plain(each) for each in cast("Sequence[Any]", value)]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def floats(vector: NDArray[np.floating[Any]]) -> list[float]:
    """Return a vector's numbers for JSON."""
    return [float(x) + 0.0 for x in vector]  # no -0


def _chunk(kind: bytes, content: bytes, fill: bytes) -> bytes:
    content += fill * (-len(content) % 4)
    return struct.pack("<I4s", len(content), kind) + content
