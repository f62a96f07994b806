"""Convert joint positions to joint rotations in closed form over all frames at once.

`solver.py` solves each frame; this module decides from the whole clip what a single frame leaves open: continuous
signs, bend planes of straight limbs from both sides in time, twists without full turns.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from marey.core.errors import InvalidInput
from marey.motion.filters import smooth
from marey.motion.kinematics import bone_lengths, global_rotations, local_rotations
from marey.motion.rigid import bodies_of, fit_rotation, rest_vectors
from marey.motion.rotations import Array, between, conjugate, multiply, normalize, rotate, unroll
from marey.motion.skeleton import Skeleton
from marey.motion.solver import FrameSolver

PLANE_SECONDS = 0.1  # standard deviation of the smoothing of bend planes in time
PLANE_PRIOR = 0.05  # weight of the neutral swing beside a fully visible bend plane (1)


@dataclass(frozen=True, eq=False)
class Pose:
    """Rotations of a skeleton over time.

    Attributes:
        skeleton: the tree, with the bone lengths that were solved for.
        rotations: (T, J, 4) float64 local quaternions, continuous in sign.
        root: (T, 3) position of joint 0.
        joints: (T, J, 3) metres, the forward kinematics of the above.
    """

    skeleton: Skeleton
    rotations: Array = field(repr=False)
    root: Array = field(repr=False)
    joints: Array = field(repr=False)

    @property
    def offsets(self) -> Array:
        """(J, 3) metres, the T-pose with this body's proportions."""
        return self.skeleton.offsets


def solve_pose(joints: Array, skeleton: Skeleton, *, fps: float = 20.0, measure: bool = True) -> Pose:
    """Solve local rotations that put a skeleton's joints at the given positions.

    Args:
        joints: (T, J, 3) metres.
        skeleton: its T-pose gives the directions of the bones.
        fps: frames a second, for the time constants.
        measure: take the bone lengths from the joints (`measure_offsets`); otherwise from the skeleton.

    Returns:
        A pose with constant bone lengths.

    Raises:
        InvalidInput: wrong shape, or numbers that are not finite.
    """
    joints = checked_joints(joints, skeleton)
    if measure:
        skeleton = skeleton.with_offsets(measure_offsets(joints, skeleton))
    local, places = FrameSolver(skeleton).solve(joints, _WholeClip(fps))
    return Pose(skeleton, unroll(local), joints[:, 0].copy(), places)


def aim_bones(joints: Array, rotations: Array, skeleton: Skeleton) -> Array:
    """Turn a pose the shortest way until its bones point at joints that were moved a little.

    Rigid bodies (hips, chest) keep their rotation: they may have been shifted, not turned. A joint without children
    turns with the bone that ends in it.

    Args:
        joints: (T, J, 3) metres, with the bone lengths of the skeleton.
        rotations: (T, J, 4) local quaternions of the pose before.

    Returns:
        (T, J, 4) local quaternions, continuous in sign.
    """
    before = global_rotations(skeleton, rotations)
    world = before.copy()
    for j, children in enumerate(skeleton.children):
        if len(children) == 1:
            bone = rotate(before[:, j], skeleton.offsets[children[0]].astype(np.float64))
            aim = joints[:, children[0]] - joints[:, j]
            world[:, j] = multiply(between(bone, aim), before[:, j])
        elif not children:
            above = skeleton.parents[j]
            world[:, j] = multiply(multiply(world[:, above], conjugate(before[:, above])), before[:, j])
    return unroll(local_rotations(skeleton, world))


def checked_joints(joints: Array, skeleton: Skeleton) -> Array:
    """Validate joints and return them as (T, J, 3) float64.

    Raises:
        InvalidInput: wrong shape, no frame, or numbers that are not finite.
    """
    joints = np.asarray(joints, np.float64)
    if joints.ndim != 3 or joints.shape[1:] != (len(skeleton), 3) or not len(joints):
        raise InvalidInput(f"joints have shape {joints.shape}, not (T, {len(skeleton)}, 3)", where=skeleton.name)
    if not np.isfinite(joints).all():
        raise InvalidInput("joints hold NaN or infinite numbers", where=skeleton.name)
    return joints


class _WholeClip:
    """Moments of one clip: each frame is resolved with the frames before and after it."""

    def __init__(self, fps: float) -> None:
        self.fps = fps

    def signs(self, q: Array) -> Array:
        return unroll(q)

    def bend(self, limb: int, seen: Array) -> Array:
        del limb
        smoothed = smooth(seen, PLANE_SECONDS * self.fps)
        twist = _unwrap(np.arctan2(smoothed[:, 1], smoothed[:, 0] + PLANE_PRIOR))
        return smooth(twist[:, None], 0.5 * PLANE_SECONDS * self.fps)[:, 0]

    def twist(self, chain: int, angles: Array) -> Array:
        del chain
        return _unwrap(angles)


def _unwrap(angles: Array) -> Array:
    """Return angles (T,) without jumps, in the full turn around zero that holds most of them."""
    unwrapped = np.asarray(np.unwrap(angles), np.float64)
    return unwrapped - 2 * np.pi * np.round(np.median(unwrapped) / (2 * np.pi))


def measure_offsets(joints: Array, skeleton: Skeleton) -> Array:
    """Measure the T-pose with the proportions of a moving body.

    Single bones keep the direction of the skeleton's T-pose and take the median of their lengths over time; rigid
    bodies (pelvis, chest) take the median place of their points in the body's own frame; all is made symmetrical.

    Args:
        joints: (T, J, 3) metres.

    Returns:
        (J, 3) float64.
    """
    template = skeleton.offsets.astype(np.float64)
    lengths = np.median(bone_lengths(joints, skeleton), axis=0)
    offsets = normalize(template) * lengths[:, None]
    for j, points in bodies_of(skeleton).items():
        seen = joints[:, points] - joints[:, j : j + 1]
        rest = rest_vectors(skeleton, template, j, points)
        # The template has other proportions, so the first fit has a frame of its own, the same at all times: it
        # measures the
        # body in a rotated frame. The second fit rotates it back to the template.
        turns = fit_rotation(rest, seen)
        body = np.median(rotate(conjugate(turns)[:, None], seen), axis=0)
        body = rotate(conjugate(fit_rotation(rest, body[None]))[0], body)
        for place, k in zip(body, points, strict=True):
            if skeleton.parents[k] == j:
                offsets[k] = place
    mirrored = offsets[list(skeleton.mirror)] * [-1.0, 1.0, 1.0]
    offsets = 0.5 * (offsets + mirrored)
    offsets[0] = template[0]
    standing = skeleton.with_offsets(offsets).rest[:, 1].min()
    offsets[0, 1] += skeleton.rest[:, 1].min() - standing  # longer legs raise the root over the floor
    return offsets
