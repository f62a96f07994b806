"""Features with the rotations of a rig: SnapMoGen's 296 numbers a frame on 24 joints (Guo et al. 2025, section 4.1).

Yaw rate, root velocity and height, 6D rotations, joint positions and velocities in the frame of the heading, foot
contacts; lengths are units of the rig, which are centimetres in its files. The differences from `HeadingLayout`:

- The yaw rate is the FULL step, and a left turn is negative: it belongs to the rotation that takes the heading to +Z.
- The 6D block holds the global rotation of every joint, seen from the heading: with the rest pose of the rig it is the
  pose, twists included, and no pose is solved from positions (`PosedLayout`).
- Root and all joints have positions and velocities; the velocity is a difference of two frames, each in its own
  heading.
- `encode` turns the root's step of t by the heading of t, `decode` by that of t + 1: the path of a turning body bends a
  little (0.004 % of its length at 60 degrees a second). The published networks are trained on that.

A published file drops frame 0 of the capture, a calibration pose; here that is the reader's part. The published yaw
rate is not wrapped, and holds values near 2 pi where a quaternion changes its sign; here it is, which decodes to the
same.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from marey.core.errors import InvalidInput
from marey.motion.filters import smooth
from marey.motion.kinematics import UP, forward_kinematics, global_rotations, local_rotations, mirror_joints
from marey.motion.mirrored_features import mirror_features
from marey.motion.pose import solve_pose
from marey.motion.rotations import (
    Array,
    about,
    conjugate,
    cross,
    from_6d,
    multiply,
    rotate,
    to_6d,
)
from marey.motion.skeleton import SNAPMOGEN, Skeleton

Float32 = NDArray[np.float32]

AHEAD = np.array([0.0, 0.0, 1.0])
FLOOR_SHARE = 0.1
"""Share of the heights of all foot joints, the lowest ones, whose mean is the floor."""


def columns(**joints: int) -> dict[str, slice]:
    """Return the columns of a frame: those of the root, numbers of each kind for the joints, and the four contacts."""
    sizes = {"yaw": 1, "velocity": 2, "height": 1, **joints, "contacts": 4}
    ends = np.cumsum(list(sizes.values())).tolist()
    return {name: slice(end - size, end) for (name, size), end in zip(sizes.items(), ends, strict=True)}


@dataclass(frozen=True, eq=False)
class RigLayout:
    """A layout with the rotations of a rig: 4 + 12 J + 4 numbers a frame.

    Attributes:
        name, fps, skeleton: see `FeatureLayout`; the skeleton is the rest pose that rotations refer to.
        left, right: joints whose differences, left minus right, are the line across the body.
        facing_sigma: standard deviation in frames of the Gaussian smoothing of the facing.
        contact_threshold: squared displacement a frame, in units squared, under which a foot stands.
        contact_heights: heights in units under which L ankle, L toe, R ankle, R toe stand.
        unit: metres in one unit of the features.
    """

    name: str
    fps: float
    skeleton: Skeleton
    left: tuple[int, ...]
    right: tuple[int, ...]
    facing_sigma: float
    contact_threshold: float
    contact_heights: tuple[float, float, float, float]
    unit: float = field(default=0.01)

    @property
    def dim(self) -> int:
        """D, the numbers of a frame."""
        return 12 * len(self.skeleton) + 8

    @property
    def slices(self) -> Mapping[str, slice]:
        """yaw, velocity, height, rotations, positions, velocities, contacts."""
        joints = len(self.skeleton)
        return columns(rotations=6 * joints, positions=3 * joints, velocities=3 * joints)

    def with_offsets(self, offsets: Array) -> RigLayout:
        """Return the same layout of a body with other offsets (J, 3), metres; features stay as they are."""
        return replace(self, skeleton=self.skeleton.with_offsets(offsets))

    def encode(self, joints: Array) -> Float32:
        """Encode joints (T, J, 3) in metres as features (T - 1, D), with the pose that is solved on the skeleton.

        Joints leave twists open; a motion with rotations is encoded by `encode_pose`.

        Raises:
            InvalidInput: wrong shape, fewer than two frames, or numbers that are not finite.
        """
        if joints.ndim != 3 or joints.shape[1:] != (len(self.skeleton), 3) or len(joints) < 2:
            wanted = f"(T >= 2, {len(self.skeleton)}, 3)"
            raise InvalidInput(f"joints have shape {joints.shape}, not {wanted}", where=self.name)
        pose = solve_pose(joints, self.skeleton, fps=self.fps, measure=False)
        return self.encode_pose(pose.rotations, pose.root)

    def encode_pose(self, rotations: Array, root: Array) -> Float32:
        """Encode a motion as features (Guo et al. 2025, section 4.1).

        Args:
            rotations: (T, J, 4) local quaternions on the skeleton's rest pose, at `fps`; T at least 2.
            root: (T, 3) position of joint 0 in metres, Y up, anywhere.

        Returns:
            (T - 1, D) float32.

        Raises:
            InvalidInput: wrong shape, fewer than two frames, or numbers that are not finite.
        """
        count = len(self.skeleton)
        if rotations.shape != (len(root), count, 4) or root.shape != (len(rotations), 3) or len(root) < 2:
            given = f"{rotations.shape} and {root.shape}"
            wanted = f"(T >= 2, {count}, 4) and (T, 3)"
            raise InvalidInput(f"rotations and root have shapes {given}, not {wanted}", where=self.name)
        if not (np.isfinite(rotations).all() and np.isfinite(root).all()):
            raise InvalidInput("the pose holds NaN or infinite numbers", where=self.name)
        world = global_rotations(self.skeleton, rotations)
        places = forward_kinematics(self.skeleton, rotations, root, world=world) / self.unit
        places[..., 1] -= _floor(places[:, list(self.skeleton.feet), 1])
        heading = self._heading(places)[:, None]  # (T, 1, 4): world to heading
        step = multiply(heading[1:, 0], conjugate(heading[:-1, 0]))
        yaw = 2 * np.arctan2(step[:, 2], step[:, 0])
        local = rotate(heading, places - places[:, :1] * [1, 0, 1])
        feet = places[:, list(self.skeleton.feet)]
        squared = np.square(feet[1:] - feet[:-1]).sum(axis=-1)
        stands = (squared < self.contact_threshold) & (feet[:-1, :, 1] < np.array(self.contact_heights))
        frames = len(places) - 1
        return np.concatenate(
            [
                (yaw - 2 * np.pi * np.round(yaw / (2 * np.pi)))[:, None],
                rotate(heading[:-1, 0], places[1:, 0] - places[:-1, 0])[:, [0, 2]],
                places[:-1, 0, 1:2],
                to_6d(multiply(heading, world))[:-1].reshape(frames, -1),
                local[:-1].reshape(frames, -1),
                (local[1:] - local[:-1]).reshape(frames, -1),
                stands,
            ],
            axis=1,
        ).astype(np.float32)

    def _heading(self, places: Array) -> Array:
        """Return the rotations (T, 4) that turn the smoothed facing of joints (T, J, 3) to +Z."""
        across = places[:, list(self.left)].sum(axis=1) - places[:, list(self.right)].sum(axis=1)
        across /= np.maximum(np.abs(across).sum(axis=-1, keepdims=True), 1e-9)  # not its length: as published
        forward = smooth(cross(across, UP), self.facing_sigma, cut=4.0)
        return about("Y", -np.arctan2(forward[:, 0], forward[:, 2]))  # also where it is straight back

    def _trajectory(self, features: Array) -> tuple[Array, Array]:
        """Return the heading (..., Tf, 4), world to heading, and the root position (..., Tf, 3) in units."""
        self._check(features)
        values = np.asarray(features[..., :4], np.float64)
        angle = np.zeros(values.shape[:-1])
        angle[..., 1:] = np.cumsum(values[..., :-1, 0], axis=-1)
        heading = about("Y", angle)
        steps = np.zeros((*values.shape[:-1], 3))
        steps[..., 1:, [0, 2]] = values[..., :-1, 1:3]
        root = np.cumsum(rotate(conjugate(heading), steps), axis=-2)
        root[..., 1] = values[..., 3]
        return heading, root

    def _check(self, features: Array) -> None:
        if features.ndim < 2 or features.shape[-1] != self.dim or not features.shape[-2]:
            raise InvalidInput(f"features have shape {features.shape}, not (..., Tf >= 1, {self.dim})", where=self.name)

    def decode_pose(self, features: Array) -> tuple[Array, Array]:
        """Decode features to the pose of the rig.

        Args:
            features: (..., Tf, D), not normalized.

        Returns:
            Local quaternions (..., Tf, J, 4), and root position (..., Tf, 3) in metres, facing +Z in frame 0.

        Raises:
            InvalidInput: wrong width or no frames.
        """
        heading, root = self._trajectory(features)
        six = np.asarray(features[..., self.slices["rotations"]], np.float64)
        seen = from_6d(six.reshape(*six.shape[:-1], len(self.skeleton), 6))
        world = multiply(conjugate(heading)[..., None, :], seen)
        return local_rotations(self.skeleton, world), root * self.unit

    def decode(self, features: Array) -> Float32:
        """Decode features (..., Tf, D) to joints (..., Tf, J, 3) in metres: the forward kinematics of `decode_pose`."""
        rotations, root = self.decode_pose(features)
        joints = forward_kinematics(self.skeleton, rotations.reshape(-1, len(self.skeleton), 4), root.reshape(-1, 3))
        return joints.reshape(*root.shape[:-1], -1, 3).astype(np.float32)

    def decode_positions(self, features: Array) -> Float32:
        """Decode the position block to joints (..., Tf, J, 3) in metres; see `decode_pose` for the rest."""
        heading, root = self._trajectory(features)
        local = np.asarray(features[..., self.slices["positions"]], np.float64)
        local = rotate(conjugate(heading)[..., None, :], local.reshape(*local.shape[:-1], -1, 3))
        return ((local + root[..., None, :] * [1, 0, 1]) * self.unit).astype(np.float32)

    def contacts(self, features: Array) -> NDArray[np.bool_]:
        """Return contacts (..., 4): L ankle, L toe, R ankle, R toe."""
        return features[..., self.slices["contacts"]] > 0.5

    def mirror_joints(self, joints: Array) -> Array:
        """See `mirror_joints`."""
        return mirror_joints(joints, self.skeleton)

    def mirror(self, features: Float32) -> Float32:
        """See `mirror_features`."""
        return mirror_features(features, self.slices, self.skeleton)


def _floor(heights: Array) -> float:
    """Return the floor under foot joints of the given heights."""
    ordered = np.sort(heights, axis=None)
    return float(ordered[: max(int(FLOOR_SHARE * len(ordered)), 1)].mean())


def _indices(*names: str) -> tuple[int, ...]:
    return tuple(SNAPMOGEN.index(f"{name}_bind_JNT") for name in names)


# Thresholds and rate of the published features.
SNAPMOGEN_296 = RigLayout(
    name="snapmogen-296",
    fps=30.0,
    skeleton=SNAPMOGEN,
    left=_indices("L_clavicle", "L_legUpper0001"),
    right=_indices("R_clavicle", "R_legUpper0001"),
    facing_sigma=5.0,
    contact_threshold=0.11,
    contact_heights=(9.0, 4.0, 9.0, 4.0),
)
