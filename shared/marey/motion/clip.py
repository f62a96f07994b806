"""A finished motion, and the npz file that holds it.

The file opens with `numpy.load(path, allow_pickle=False)`; it is always in metres, Y up, facing +Z in frame 0. Its keys
are stable: joints, rotations, root, offsets, parents, names, fps, contacts, features, features_fps, manifest.
"""

from __future__ import annotations

import io
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from marey.core.arrays import check_array, text_of
from marey.core.arrays import parse_npz as parse_arrays
from marey.core.documents import parse_json
from marey.core.errors import InvalidFile, InvalidInput
from marey.motion.files import read_limited, write_atomically
from marey.motion.kinematics import forward_kinematics
from marey.motion.provenance import check_manifest
from marey.motion.rotations import Array
from marey.motion.skeleton import Skeleton, skeleton_of
from marey.motion.units import FARTHEST

Float32 = NDArray[np.float32]
Bool = NDArray[np.bool_]

QUALITY, SELECTION = "quality", "selection"
"""Keys of a manifest: the records of the quality of a motion, and of its choice among candidates (`marey.quality`)."""
MAX_UNPACKED = 2**30  # bytes; an hour of 22 joints at 120 fps takes 0.4 GiB
KEYS = (
    "joints",
    "rotations",
    "root",
    "offsets",
    "parents",
    "names",
    "fps",
    "contacts",
    "features",
    "features_fps",
    "manifest",
)


FOREIGN = "The file was not written by Marey, or by an old version."


def _nothing() -> Float32:
    return np.zeros((0, 0), np.float32)


@dataclass(frozen=True, eq=False)
class MotionClip:
    """Poses of one body over time, in metres, Y up.

    Attributes:
        skeleton: the tree with this body's offsets.
        rotations: (T, J, 4) local quaternions `w x y z`.
        root: (T, 3) position of the root.
        joints: (T, J, 3) metres, the forward kinematics of skeleton, rotations and root.
        contacts: (T, 4) bool, True where L ankle, L toe, R ankle, R toe touch the floor.
        fps: frames a second.
        features: (Tf, D) as generated, before clean-up and resampling; (0, 0) for a motion without a model.
        features_fps: their rate; 0 without features.
        manifest: provenance of the motion; JSON.
    """

    skeleton: Skeleton
    rotations: Float32 = field(repr=False)
    root: Float32 = field(repr=False)
    joints: Float32 = field(repr=False)
    contacts: Bool = field(repr=False)
    fps: float
    features: Float32 = field(default_factory=_nothing, repr=False)
    features_fps: float = 0.0
    manifest: Mapping[str, Any] = field(default_factory=dict[str, Any], repr=False)

    @classmethod
    def of(
        cls,
        skeleton: Skeleton,
        rotations: Array,
        root: Array,
        contacts: Bool,
        fps: float,
        *,
        features: Array | None = None,
        features_fps: float = 0.0,
        manifest: Mapping[str, Any] | None = None,
    ) -> MotionClip:
        """Create a clip; its joints are computed from the rotations by forward kinematics."""
        rotations, root = np.asarray(rotations, np.float32), np.asarray(root, np.float32)
        return cls(
            skeleton=skeleton,
            rotations=rotations,
            root=root,
            joints=forward_kinematics(skeleton, rotations, root).astype(np.float32),
            contacts=np.asarray(contacts, bool),
            fps=float(fps),
            features=_nothing() if features is None else np.asarray(features, np.float32),
            features_fps=float(features_fps),
            manifest=manifest or {},
        )

    @property
    def offsets(self) -> Float32:
        """(J, 3) rest pose in metres: the T-pose with this body's proportions."""
        return self.skeleton.offsets

    @property
    def frames(self) -> int:
        """Number of frames T."""
        return len(self.root)

    @property
    def seconds(self) -> float:
        """Duration in seconds."""
        return self.frames / self.fps

    def to_npz(self) -> bytes:
        """Encode the clip as an npz file. Equal clips give equal bytes."""
        names = np.array(self.skeleton.joint_names)
        buffer = io.BytesIO()
        np.savez(
            buffer,
            joints=self.joints,
            rotations=self.rotations,
            root=self.root,
            offsets=self.offsets,
            parents=np.array(self.skeleton.parents, np.int32),
            names=names,
            fps=np.float64(self.fps),
            contacts=self.contacts,
            features=self.features,
            features_fps=np.float64(self.features_fps),
            manifest=np.array(json.dumps(self.manifest, ensure_ascii=False, sort_keys=True)),
        )
        return buffer.getvalue()

    def save_npz(self, path: Path | str) -> None:
        """Write the npz file atomically."""
        write_atomically(Path(path), self.to_npz())


def load_npz(path: Path | str) -> MotionClip:
    """Read a clip.

    Raises:
        NotFound: no such file.
        InvalidFile: missing keys, wrong shapes or types, pickles, non-finite numbers, or an invalid joint tree.
        TooLarge: more than `MAX_UNPACKED` bytes inside.
    """
    path = Path(path)
    return parse_npz(read_limited(path, MAX_UNPACKED), str(path))


def parse_npz(data: bytes, where: str = "npz") -> MotionClip:
    """Read the bytes of a clip's npz file; see `load_npz`."""
    found = _ClipArrays(data, where)
    joints = found.places("joints", None, None)
    frames, count = joints.shape[:2]
    rotations = found.floats("rotations", frames, count, 4)
    parents = tuple(int(p) for p in found.array("parents", "iu", count).tolist())
    fps, features_fps = float(found.array("fps", "f")), float(found.array("features_fps", "f"))
    if not frames or not 0 < fps <= 1000:
        raise InvalidFile(f"{frames} frames at {fps:g} fps", where=where)
    if np.abs(np.linalg.norm(np.clip(rotations, -2, 2), axis=-1) - 1).max(initial=0) > 1e-3:
        raise InvalidFile("`rotations` holds quaternions that are not of unit length", where=where)
    try:
        names = tuple(str(n) for n in found.array("names", "U", count).tolist())
        manifest = found.manifest()
        skeleton = skeleton_of(names, parents, found.places("offsets", count))
    except InvalidFile:  # it names the file already
        raise
    except (ValueError, InvalidInput) as error:
        raise InvalidFile(str(error), where=where) from None
    return MotionClip(
        skeleton=skeleton,
        rotations=rotations,
        root=found.places("root", frames),
        joints=joints,
        contacts=found.array("contacts", "b", frames, 4),
        fps=fps,
        features=found.floats("features", None, None),
        features_fps=features_fps,
        manifest=check_manifest(manifest, where),
    )


class _ClipArrays:
    """The arrays of a clip's npz file, checked when they are taken; lengths of axes are given, None = any length."""

    def __init__(self, data: bytes, where: str) -> None:
        self._arrays = parse_arrays(data, where, KEYS, limit=MAX_UNPACKED, hint=FOREIGN)
        self._where = where

    def array(self, key: str, kinds: str, *shape: int | None) -> NDArray[Any]:
        """Return an array whose type is one of `kinds` (see `check_array`)."""
        return check_array(self._arrays[key], key, self._where, kinds=kinds, shape=shape)

    def floats(self, key: str, *shape: int | None) -> Float32:
        """Return an array of finite numbers, as float32."""
        with np.errstate(over="ignore"):  # a number too large for float32 becomes infinite and is refused
            array = self.array(key, "f", *shape).astype(np.float32, copy=False)
        return check_array(array, key, self._where, kinds="f", shape=shape)

    def places(self, key: str, *shape: int | None) -> Float32:
        """Return points (*shape, 3) in metres, none farther away than `FARTHEST`."""
        array = self.floats(key, *shape, 3)
        if np.abs(array).max(initial=0) > FARTHEST:
            raise InvalidFile(f"`{key}` holds numbers over {FARTHEST:,.0f}", where=self._where)
        return array

    def manifest(self) -> Any:
        """Return the JSON value of the manifest, not yet checked."""
        text = text_of(self._arrays["manifest"], "manifest", self._where)
        return parse_json(text, f"{self._where}: manifest", allow_nan=True)
