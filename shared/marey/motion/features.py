"""Feature layouts: the vectors that models read and write, to joints and back.

A layout is a parameter everywhere. `HeadingLayout` is HumanML3D's representation (Guo et al. 2022, section 4.1), with
263 numbers a frame on 22 joints and 251 on KIT's 21: root yaw rate, root velocity and height, joint positions and
velocities in the frame of the heading, 6D rotations, foot contacts. Its pitfalls, all handled below:

- The yaw rate is HALF the yaw step (the angle inside the quaternion); the heading in the world turns by -2 x the sum.
- The root velocity of step t is turned by the heading of t + 1, the joint velocities by the heading of t.
- Joint positions lose the root's X and Z, but keep their height over the floor.
- The 6D block turns raw bone directions, not a T-pose, and every chain starts again from the root: it is not a set of
  local rotations of any rig, and no decoder here reads it. Poses come from positions (`pose.py`).
- T poses give T - 1 feature frames.

HumanML3D's own script takes the yaw step from the sine of half quaternions kept at w >= 0, which has the wrong sign
at the frame where the body passes facing -Z; here the angle is unwrapped, so decoding gives back the joints there too.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal, Protocol, cast, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from marey.core.errors import InvalidInput, NotFound
from marey.motion.filters import smooth
from marey.motion.kinematics import across, facing, mirror_joints
from marey.motion.mirrored_features import mirror_features
from marey.motion.rig_features import SNAPMOGEN_296, columns
from marey.motion.rotations import Array, about, between, conjugate, multiply, normalize, rotate, to_6d
from marey.motion.skeleton import HUMANML3D, KIT, Skeleton

Float32 = NDArray[np.float32]


@runtime_checkable
class FeatureLayout(Protocol):
    """Port of feature layouts: the meaning of a model's feature vectors."""

    @property
    def name(self) -> str:
        """Short name as written into manifests, for instance `humanml3d-263`."""
        ...

    @property
    def dim(self) -> int:
        """D, numbers a frame."""
        ...

    @property
    def fps(self) -> float:
        """Frames a second of the features."""
        ...

    @property
    def skeleton(self) -> Skeleton:
        """The joints that the features describe."""
        ...

    @property
    def slices(self) -> Mapping[str, slice]:
        """Groups of the vector, in order; statistics are averaged within a group."""
        ...

    def encode(self, joints: Array) -> Float32:
        """Encode joints (T, J, 3) in metres, Y up, as features (T - 1, D); the motion is canonicalized first."""
        ...

    def decode(self, features: Array) -> Float32:
        """Decode features (..., Tf, D) to joints (..., Tf, J, 3) in metres, Y up, facing +Z in frame 0."""
        ...

    def contacts(self, features: Array) -> NDArray[np.bool_]:
        """Return foot contacts (..., Tf, 4) of features (..., Tf, D): L ankle, L toe, R ankle, R toe."""
        ...

    def mirror_joints(self, joints: Array) -> Array:
        """Mirror a motion (..., J, 3): exchange left and right."""
        ...

    def mirror(self, features: Float32) -> Float32:
        """Mirror features (..., Tf, D): exchange left and right."""
        ...

    def with_offsets(self, offsets: Array) -> FeatureLayout:
        """Return the same layout of a body with other offsets (J, 3), metres."""
        ...


@runtime_checkable
class PosedLayout(FeatureLayout, Protocol):
    """Port of layouts whose features hold the rotations of the skeleton: no pose is solved from positions."""

    def encode_pose(self, rotations: Array, root: Array) -> Float32:
        """Encode local quaternions (T, J, 4) and root (T, 3) in metres as features (T - 1, D)."""
        ...

    def decode_pose(self, features: Array) -> tuple[Array, Array]:
        """Decode features (..., Tf, D) to local quaternions (..., Tf, J, 4) and root (..., Tf, 3) in metres, facing +Z
        in frame 0."""
        ...


LIFTED = 0.1
"""Metres over the floor that a body which hangs or swims never comes nearer to it."""


def encode_all(layout: FeatureLayout, joints: Array) -> Float32:
    """Encode a motion (T, J, 3) as features (T, D): those of a frame hold the step to the next, so the last step is
    repeated. A body that stays over the floor y = 0, as one that hangs does, keeps its height; every other one is put
    onto the floor, as by `canonicalize`."""
    lowest = float(joints[..., 1].min())
    beyond = 2 * joints[-1:] - joints[-2:-1]
    # The lowest point of all frames becomes the floor, and a foot that comes down at the end would go on through it:
    # the whole motion would be lifted by a frame that it does not have.
    beyond[..., 1] = np.maximum(beyond[..., 1], lowest)
    whole = np.concatenate([joints, beyond])
    if lowest < LIFTED:
        return layout.encode(whole)
    on_floor = whole[-1:] - [0.0, float(whole[-1, :, 1].min()), 0.0]  # a frame more, of which the floor is found
    return layout.encode(np.concatenate([whole, on_floor]))[:-1]


def canonicalize(joints: Array, skeleton: Skeleton) -> Array:
    """Canonicalize a motion: facing +Z in frame 0, root over the origin in frame 0, lowest point at y = 0.

    Args:
        joints: (T, J, 3) metres, Y up.

    Returns:
        (T, J, 3) float64.
    """
    joints = np.array(joints, np.float64)
    joints -= [joints[0, 0, 0], joints[..., 1].min(), joints[0, 0, 2]]
    forward = facing(joints[0], skeleton)
    return rotate(about("Y", -np.arctan2(forward[0], forward[2])), joints)


@dataclass(frozen=True, eq=False)
class HeadingLayout:
    """HumanML3D's layout for any skeleton: 1 + 2 + 1 + 3 (J - 1) + 6 (J - 1) + 3 J + 4 numbers a frame.

    Attributes:
        name, fps, skeleton: see `FeatureLayout`.
        directions: (J, 3) raw direction of the bone from the parent, for the 6D block alone.
        contact_threshold: squared displacement a frame, in units squared, under which a foot stands.
        facing_sigma: standard deviation in frames of the Gaussian smoothing of the facing; 0 = none.
        facing_hips: weight of the hips beside the shoulders in the smoothed facing. The published vectors have -1: the
            script that made them unpacks (r_hip, l_hip) as (l_hip, r_hip) there, though not where it places frame 0.
        facing_start: which facing is +Z in frame 0. The published vectors take the measured one and then call the
            smoothed one of frame 0 zero too, which leaves a jump of the heading after frame 0 (12 degrees in clip
            012314); with `smoothed` there is none.
        facing_held: hold the facing where the body has none, as on its side or in the middle of a cartwheel; see
            `held_across`. The published vectors do not.
        unit: metres in one unit of the features (KIT-ML counts millimetres).
    """

    name: str
    fps: float
    skeleton: Skeleton
    directions: Array = field(repr=False)
    contact_threshold: float
    facing_sigma: float = 20.0
    facing_hips: float = 1.0
    facing_start: Literal["measured", "smoothed"] = "measured"
    facing_held: bool = False
    unit: float = 1.0

    @property
    def dim(self) -> int:
        """D, the numbers of a frame."""
        return 12 * len(self.skeleton) - 1

    @property
    def slices(self) -> Mapping[str, slice]:
        """yaw, velocity, height, positions, rotations, velocities, contacts."""
        joints = len(self.skeleton)
        return columns(positions=3 * (joints - 1), rotations=6 * (joints - 1), velocities=3 * joints)

    def with_facing(
        self,
        *,
        sigma: float,
        hips: float = 1.0,
        start: Literal["measured", "smoothed"] = "smoothed",
        held: bool = False,
    ) -> HeadingLayout:
        """Return the same layout with another method to find the heading; decoding does not change."""
        return replace(self, facing_sigma=sigma, facing_hips=hips, facing_start=start, facing_held=held)

    def with_offsets(self, offsets: Array) -> HeadingLayout:
        """Return the same layout of a body with other offsets (J, 3), metres; features stay as they are."""
        return replace(self, skeleton=self.skeleton.with_offsets(offsets))

    def canonicalize(self, joints: Array) -> Array:
        """Return the motion (T, J, 3) in the place that `encode` gives it: see `canonicalize` and `facing_start`."""
        return self._place(joints)[0]

    def _place(self, joints: Array) -> tuple[Array, Array]:
        """Return canonical joints (T, J, 3), and half the yaw (T,) that turns the smoothed facing to +Z: radians,
        unwrapped, zero in frame 0."""
        places = canonicalize(joints, self.skeleton)
        right = across(places, self.skeleton, hips=self.facing_hips)
        if self.facing_held:
            right = held_across(right, places, self.skeleton)
        right = smooth(right[:, [0, 2]], self.facing_sigma, cut=4.0)  # a shorter vector in the plane weighs less
        half_yaw = -0.5 * np.unwrap(np.arctan2(right[:, 1], -right[:, 0]))  # forward = up x right
        if self.facing_start == "smoothed":
            places = rotate(about("Y", 2 * half_yaw[0]), places)
            half_yaw -= half_yaw[0]
        half_yaw[0] = 0.0
        return places, half_yaw

    def encode(self, joints: Array) -> Float32:
        """Encode a motion as features (Guo et al. 2022, section 4.1).

        Args:
            joints: (T, J, 3) metres, Y up, at `fps`, anywhere and facing anywhere; T at least 2.

        Returns:
            (T - 1, D) float32. `decode` of it equals `self.canonicalize(joints)[:-1]` to rounding.

        Raises:
            InvalidInput: wrong shape, fewer than two frames, or numbers that are not finite.
        """
        if joints.ndim != 3 or joints.shape[1:] != (len(self.skeleton), 3) or len(joints) < 2:
            wanted = f"(T >= 2, {len(self.skeleton)}, 3)"
            raise InvalidInput(f"joints have shape {joints.shape}, not {wanted}", where=self.name)
        if not np.isfinite(joints).all():
            raise InvalidInput("joints hold NaN or infinite numbers", where=self.name)
        places, half_yaw = self._place(joints)
        places /= self.unit
        heading = np.zeros((len(places), 1, 4))  # (T, 1, 4): world to heading
        heading[:, 0, 0], heading[:, 0, 2] = np.cos(half_yaw), np.sin(half_yaw)
        steps = places[1:] - places[:-1]
        local = places.copy()
        local[..., [0, 2]] -= places[:, :1, [0, 2]]
        local = rotate(heading, local)
        squared = np.einsum("tji,tji->tj", *[steps[:, list(self.skeleton.feet)]] * 2)
        frames = len(steps)
        return np.concatenate(
            [
                np.diff(half_yaw)[:, None],
                rotate(heading[1:, 0], steps[:, 0])[:, [0, 2]],
                places[:-1, 0, 1:2],
                local[:-1, 1:].reshape(frames, -1),
                to_6d(self._bone_rotations(places[:-1], heading[:-1]))[:, 1:].reshape(frames, -1),
                rotate(heading[:-1], steps).reshape(frames, -1),
                squared < self.contact_threshold,
            ],
            axis=1,
        ).astype(np.float32)

    def _bone_rotations(self, places: Array, heading: Array) -> Array:
        """Return the rotation (T, J, 4) of each bone from its raw direction, relative to the bone before it in its
        chain; chains begin at the root's children and at every branch, each again from the root rotation."""
        skeleton = self.skeleton
        parents = np.array([max(p, 0) for p in skeleton.parents])
        directions = np.array(self.directions, np.float64)
        directions[0] = [0, 0, 1]  # arbitrary: the root has no bone
        bones = places - places[:, parents]
        bones[:, 0] = [0, 0, 1]
        world = between(directions, bones)
        before = world[:, parents]
        begins = [j for j, p in enumerate(skeleton.parents) if p <= 0 or skeleton.children[p][0] != j]
        before[:, begins] = heading
        return multiply(conjugate(before), world)

    def root_trajectory(self, features: Array) -> tuple[Array, Array]:
        """Return half yaw (..., Tf) in radians and root position (..., Tf, 3) in metres, by summing the first four
        numbers."""
        values = np.asarray(features[..., :4], np.float64)
        half_yaw = np.zeros(values.shape[:-1])
        half_yaw[..., 1:] = np.cumsum(values[..., :-1, 0], axis=-1)
        root = np.zeros((*values.shape[:-1], 3))
        steps = to_world(half_yaw[..., 1:], values[..., :-1, 1:3])  # the step of t - 1 was turned by the heading of t
        root[..., 1:, [0, 2]] = np.cumsum(steps, axis=-2)
        root[..., 1] = values[..., 3]
        return half_yaw, root * self.unit

    def decode(self, features: Array) -> Float32:
        """Decode features to joints, from the root's motion and the positions.

        Args:
            features: (..., Tf, D), not normalized.

        Returns:
            (..., Tf, J, 3) float32, metres, facing +Z in frame 0.

        Raises:
            InvalidInput: wrong width or no frames.
        """
        if features.ndim < 2 or features.shape[-1] != self.dim or not features.shape[-2]:
            raise InvalidInput(f"features have shape {features.shape}, not (..., Tf >= 1, {self.dim})", where=self.name)
        return self.place_joints(features, *self.root_trajectory(features))

    def place_joints(self, features: Array, half_yaw: Array, root: Array) -> Float32:
        """Decode features (..., D) to joints (..., J, 3), given half yaw (...) and root position (..., 3) in metres."""
        local = np.asarray(features[..., self.slices["positions"]], np.float64)
        local = local.reshape(*local.shape[:-1], -1, 3) * self.unit
        joints = np.empty((*local.shape[:-2], len(self.skeleton), 3), np.float32)
        joints[..., 0, :] = root
        flat = to_world(half_yaw[..., None], local[..., [0, 2]])
        joints[..., 1:, [0, 2]] = flat + root[..., None, [0, 2]]
        joints[..., 1:, 1] = local[..., 1]
        return joints

    def move_joints(self, features: Float32, moved: Array) -> Float32:
        """Return features (T, D) of joints that are moved by (T, J, 3) metres in the world of `decode`; the root stays,
        and so do the 6D block and the contacts, which `decode` does not read."""
        half_yaw = self.root_trajectory(features)[0]
        steps = np.diff(moved, axis=0, append=moved[-1:])
        changed = features.copy()
        for name, values in (("positions", moved[:, 1:]), ("velocities", steps)):
            local = np.array(values, np.float64) / self.unit
            local[..., [0, 2]] = to_world(-half_yaw[:, None], local[..., [0, 2]])
            changed[:, self.slices[name]] += local.reshape(len(local), -1).astype(np.float32)
        return changed

    def contacts(self, features: Array) -> NDArray[np.bool_]:
        """Return contacts (..., Tf, 4): L ankle, L toe, R ankle, R toe."""
        return features[..., self.slices["contacts"]] > 0.5

    def mirror_joints(self, joints: Array) -> Array:
        """See `mirror_joints`."""
        return mirror_joints(joints, self.skeleton)

    def mirror(self, features: Float32) -> Float32:
        """See `mirror_features`."""
        return mirror_features(features, self.slices, self.skeleton)


LEAST_ACROSS = 0.5  # of the line from left to right that lies in the floor plane
LEAST_UP = -0.3  # of the trunk's direction; an upside-down body may have its left on either side


def held_across(right: Array, joints: Array, skeleton: Skeleton) -> Array:
    """Lines from left to right (T, 3), replaced where they tell no heading: in a body on its side the line is upright,
    and in a cartwheel it comes out of that reversed.

    There the heading is held: it goes the shorter way round from the last frame that has one to the next. Where all
    frames have one, or none, nothing changes.
    """
    r_hip, l_hip, r_shoulder, l_shoulder = skeleton.facing
    trunk = joints[:, [r_shoulder, l_shoulder]].mean(axis=1) - joints[:, [r_hip, l_hip]].mean(axis=1)
    clear = (np.hypot(right[:, 0], right[:, 2]) > LEAST_ACROSS) & (normalize(trunk)[:, 1] > LEAST_UP)
    if clear.all() or not clear.any():
        return right
    known = np.flatnonzero(clear)
    turns = np.unwrap(np.arctan2(right[known, 2], right[known, 0]))
    angles = cast("Array", np.interp(np.arange(len(right)), known, turns))
    held = np.stack([np.cos(angles), np.zeros(len(right)), np.sin(angles)], axis=-1)
    return np.where(clear[:, None], right, held)


def to_world(half_yaw: Array, flat: Array) -> Array:
    """Turn X and Z of vectors (..., 2) from the frame of a heading to the world: about Y by -2 half_yaw."""
    cos, sin = np.cos(2 * half_yaw), -np.sin(2 * half_yaw)
    x, z = flat[..., 0], flat[..., 1]
    return np.stack([cos * x + sin * z, cos * z - sin * x], axis=-1)


def _directions(rows: str) -> Array:
    """One letter per joint: x y z for +, X Y Z for -, o for the root."""
    axes = {"o": (0, 0, 0), "x": (1, 0, 0), "X": (-1, 0, 0), "y": (0, 1, 0), "Y": (0, -1, 0), "z": (0, 0, 1)}
    return normalize(np.array([axes[letter] for letter in rows], np.float64))


# Raw directions, thresholds and rates: EricGuo5513/momask-codes, utils/paramUtil.py and motion_process.py (MIT).
HUMANML3D_263 = HeadingLayout(
    name="humanml3d-263",
    fps=20.0,
    skeleton=HUMANML3D,
    directions=_directions("oxXyYYyYYyzzyxXzYYYYYY"),
    contact_threshold=0.002,
    facing_hips=-1.0,
)
KIT_251 = HeadingLayout(
    name="kit-251",
    fps=12.5,
    skeleton=KIT,
    directions=_directions("oyyyyxYYXYYxYYzzXYYzz"),
    contact_threshold=0.05,
    facing_hips=-1.0,
    unit=0.001,
)

LAYOUTS: Mapping[str, FeatureLayout] = {each.name: each for each in (HUMANML3D_263, KIT_251, SNAPMOGEN_296)}


def layout(name: str) -> FeatureLayout:
    """Return a layout by its name.

    Raises:
        NotFound: the name is unknown.
    """
    try:
        return LAYOUTS[name]
    except KeyError:
        raise NotFound(f"unknown feature layout `{name}`", hint=f"Known: {', '.join(LAYOUTS)}.") from None
