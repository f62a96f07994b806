"""Read the glb files that Marey writes (`glb_write.py`), with everything but the features.

Files of other programs are refused: their nodes, skins and animations may mean anything.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from marey.core.documents import parse_json
from marey.core.errors import InvalidFile, InvalidInput
from marey.motion.arrange import placement_of
from marey.motion.clip import MAX_UNPACKED, MotionClip
from marey.motion.files import read_limited
from marey.motion.io.glb_write import BIN, FEET, FLOAT, GENERATOR, JSON, MAGIC, VERSION
from marey.motion.io.rigged_glb_read import hips_motion
from marey.motion.provenance import check_manifest
from marey.motion.rigs.landmarks import feet_and_facing
from marey.motion.rotations import Array, conjugate, multiply, rotate
from marey.motion.skeleton import skeleton_of
from marey.motion.units import FARTHEST

WIDTHS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}
FOREIGN = "Only glb files of Marey are read; export a BVH file from the program that wrote this one."


def read_glb(path: Path | str) -> MotionClip:
    """Read a glb file of Marey: the clip without its features. A root bone and a T-pose frame are taken out again.

    Raises:
        NotFound: no such file.
        InvalidFile: broken, or of another program.
        TooLarge: over 1 GiB.
    """
    path = Path(path)
    return parse_glb(read_limited(path, MAX_UNPACKED), str(path))


def parse_glb(data: bytes, where: str = "glb") -> MotionClip:
    """Read the bytes of a glb file; see `read_glb`."""
    document, numbers = _chunks(data, where)
    try:
        with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is refused below
            clip = _clip(_Document(document, numbers, where))
            if not np.isfinite(clip.joints).all():
                raise InvalidFile("holds numbers that are too large", where=where)
            return clip
    except InvalidFile:
        raise
    except (ValueError, KeyError, IndexError, TypeError, AttributeError, OverflowError, InvalidInput) as error:
        raise InvalidFile(f"is not a motion that Marey wrote: {error}", where=where, hint=FOREIGN) from None


def _chunks(data: bytes, where: str) -> tuple[dict[str, Any], bytes]:
    """Return the JSON and the numbers of a file (4.4)."""
    if len(data) < 20 or data[:4] != MAGIC:
        raise InvalidFile("is not a glb file", where=where)
    version, length, size = struct.unpack_from("<III", data, 4)
    if version != VERSION:
        raise InvalidFile(f"is glTF {version}; only glTF {VERSION} is read", where=where)
    start = 20 + size + 8
    if length != len(data) or data[16:20] != JSON or start > len(data) or data[start - 4 : start] != BIN:
        raise InvalidFile("is cut off, or its chunks are broken", where=where)
    document = parse_json(data[20 : 20 + size], where)
    if not isinstance(document, dict):
        raise InvalidFile("its JSON is not an object", where=where)
    document = cast("dict[str, Any]", document)
    asset = document.get("asset")
    if not isinstance(asset, dict) or cast("dict[str, Any]", asset).get("generator") != GENERATOR:
        raise InvalidFile("was not written by Marey", where=where, hint=FOREIGN)
    return document, data[start:]


class _Document:
    """The JSON of a file and its numbers. The first nodes are the joints; a body may come after them."""

    def __init__(self, document: Mapping[str, Any], data: bytes, where: str) -> None:
        self.document, self.data, self.where = document, data, where
        self.extras: Mapping[str, Any] = document["asset"]["extras"]
        self.rigged: Mapping[str, Any] | None = self.extras.get("rigged")
        joints = len(document["skins"][0]["joints"])
        self.nodes: list[Mapping[str, Any]] = document["nodes"][: joints if self.rigged is None else None]
        self._check(np.array([number for node in self.nodes for number in node.get("translation", ())], np.float64))

    def values(self, accessor: int) -> NDArray[np.float32]:
        """Return the numbers (N, width) of an accessor."""
        about = self.document["accessors"][accessor]
        view = self.document["bufferViews"][about["bufferView"]]
        width, offset = WIDTHS[about["type"]], int(view["byteOffset"])
        count = int(about["count"])
        if about["componentType"] != FLOAT or offset < 0 or count < 1:
            raise InvalidFile("its numbers are not float32", where=self.where)
        values = np.frombuffer(self.data, "<f4", count * width, offset).reshape(count, width)
        self._check(values)
        return values

    def _check(self, values: Array) -> None:
        """Raise InvalidFile unless all numbers are finite and within `FARTHEST`, so that their sums are, too."""
        if not (np.abs(values) <= FARTHEST).all():
            raise InvalidFile(f"holds NaN, or numbers over {FARTHEST:,.0f}", where=self.where)

    def tracks(self, path: str) -> dict[int, NDArray[np.float32]]:
        """Return the animated values (T, width) of nodes by their index."""
        animation = self.document["animations"][0]
        return {
            channel["target"]["node"]: self.values(animation["samplers"][channel["sampler"]]["output"])
            for channel in animation["channels"]
            if channel["target"]["path"] == path
        }


def _clip(file: _Document) -> MotionClip:
    if file.rigged is not None:
        return _rigged_clip(file, file.rigged)
    count, options = len(file.nodes), file.extras["options"]
    turns, places = file.tracks("rotation"), file.tracks("translation")
    rotations = np.stack([turns[joint] for joint in range(count)], axis=1)[..., [3, 0, 1, 2]]  # w x y z
    root, names = places[0], [str(node["name"]) for node in file.nodes]
    parents = [-1] * count
    for parent, node in enumerate(file.nodes):
        for child in node.get("children", ()):
            parents[child] = parent
    offsets = np.array([node["translation"] for node in file.nodes], np.float32)
    if options.get("tpose_frame"):
        rotations, root = rotations[1:], root[1:]
        places = {joint: track[1:] for joint, track in places.items()}
    if options.get("root_bone"):
        rotations, root = _without_root_bone(rotations, root, places[1])
        names, offsets, parents = names[1:], offsets[1:], [parent - 1 for parent in parents[1:]]
        parents[0] = -1
    if not len(root) or np.abs(np.linalg.norm(rotations, axis=-1) - 1).max() > 1e-3:
        raise InvalidFile("has no frames, or rotations that are none", where=file.where)
    clip = MotionClip.of(
        skeleton_of(tuple(names), tuple(parents), offsets),
        rotations,
        root,
        _contacts(file, len(root)),
        _rate(file),
        manifest=check_manifest(file.extras["manifest"], file.where),
    )
    return _back_at_origin(clip) if options.get("placement") == "keep" else clip


def _rigged_clip(file: _Document, rigged: Mapping[str, Any]) -> MotionClip:
    """Return the body of a rig from the hips down, where it is in the file."""
    first = int(bool(file.extras["options"].get("tpose_frame")))
    motion = hips_motion(file.nodes, file.tracks("rotation"), file.tracks("translation"), int(rigged["hips"]))
    feet, looks = feet_and_facing(motion.skeleton)
    root = motion.root[first:]
    return MotionClip.of(
        replace(motion.skeleton, feet=feet, facing=looks),
        motion.rotations[first:],
        root,
        _contacts(file, len(root)),
        _rate(file),
        manifest=check_manifest(file.extras["manifest"], file.where),
    )


def _rate(file: _Document) -> float:
    fps = float(file.extras["fps"])
    if not 0 < fps <= 1000:
        raise InvalidFile(f"{fps:g} fps", where=file.where)
    return fps


def _without_root_bone(rotations: Array, root: Array, pelvis: Array) -> tuple[Array, Array]:
    """Merge joint 0 into joint 1; return rotations (T, J - 1, 4) and root (T, 3)."""
    heading = rotations[:, 0].astype(np.float64)
    merged = multiply(heading, rotations[:, 1].astype(np.float64))
    return np.concatenate([merged[:, None], rotations[:, 2:]], axis=1), root + rotate(heading, pelvis)


def _back_at_origin(clip: MotionClip) -> MotionClip:
    turn, shift = placement_of(clip)
    back = conjugate(turn)
    rotations = clip.rotations.astype(np.float64)
    rotations[:, 0] = multiply(back, rotations[:, 0])
    return MotionClip.of(
        clip.skeleton, rotations, rotate(back, clip.root - shift), clip.contacts, clip.fps, manifest=clip.manifest
    )


def _contacts(file: _Document, frames: int) -> NDArray[np.bool_]:
    """Return contacts (T, 4) from the stretches in which a foot stands."""
    contacts = np.zeros((frames, len(FEET)), bool)
    first = int(bool(file.extras["options"].get("tpose_frame")))
    for column, foot in enumerate(FEET):
        for begin, end in file.extras["contacts"].get(foot, ()):
            if not 0 <= begin - first < end - first <= frames:
                raise InvalidFile(f"{foot} stands in frames that are not there", where=file.where)
            contacts[begin - first : end - first, column] = True
    return contacts
