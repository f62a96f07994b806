"""Forward kinematics and measurements on joints."""

from __future__ import annotations

import numpy as np

from marey.motion.rotations import Array, conjugate, cross, multiply, normalize, rotate
from marey.motion.skeleton import Skeleton

UP = np.array([0.0, 1.0, 0.0])


def global_rotations(skeleton: Skeleton, rotations: Array) -> Array:
    """Convert local quaternions (T, J, 4) to world ones, one level of the tree at a time."""
    world = np.array(rotations, np.float64)
    parents = np.array(skeleton.parents)
    for level in skeleton.levels[1:]:
        world[:, level] = multiply(world[:, parents[level]], world[:, level])
    return world


def local_rotations(skeleton: Skeleton, world: Array) -> Array:
    """Convert world quaternions (..., J, 4) to local ones."""
    local = np.array(world, np.float64)
    parents = np.array(skeleton.parents[1:])
    local[..., 1:, :] = multiply(conjugate(world[..., parents, :]), world[..., 1:, :])
    return local


def forward_kinematics(
    skeleton: Skeleton, rotations: Array, root: Array, *, positions: Array | None = None, world: Array | None = None
) -> Array:
    """Compute joint positions of a pose (forward kinematics).

    Args:
        skeleton: its offsets are the bones, in metres.
        rotations: (T, J, 4) local quaternions `w x y z`.
        root: (T, 3) position of joint 0 in the world (the root's own offset is not added).
        positions: (T, J, 3) local translations in place of the offsets, if bones change length; metres.
        world: (T, J, 4) world rotations, if the caller has them already.

    Returns:
        (T, J, 3) float64, metres, in the world frame of `root`.
    """
    world = global_rotations(skeleton, rotations) if world is None else world
    offsets = np.asarray(skeleton.offsets if positions is None else positions, np.float64)
    parents = np.array(skeleton.parents)
    joints = np.empty((*world.shape[:2], 3))
    joints[:, 0] = root
    for level in skeleton.levels[1:]:
        joints[:, level] = joints[:, parents[level]] + rotate(world[:, parents[level]], offsets[..., level, :])
    return joints


def bone_lengths(joints: Array, skeleton: Skeleton) -> Array:
    """Return the distance (T, J) of each joint from its parent; zero for the root."""
    parents = np.array([max(p, 0) for p in skeleton.parents])
    return np.linalg.norm(joints - joints[..., parents, :], axis=-1)


def across(joints: Array, skeleton: Skeleton, *, hips: float = 1.0) -> Array:
    """Return unit vectors (..., 3) from the left to the right of the body: shoulders and hips together.

    As in HumanML3D: r_hip - l_hip + r_shoulder - l_shoulder; `hips` weighs the hips' part.
    """
    r_hip, l_hip, r_shoulder, l_shoulder = skeleton.facing
    shoulders = joints[..., r_shoulder, :] - joints[..., l_shoulder, :]
    return normalize(shoulders + hips * (joints[..., r_hip, :] - joints[..., l_hip, :]))


def facing(joints: Array, skeleton: Skeleton) -> Array:
    """Return the facing direction of the body: unit vectors (..., 3) in the floor plane, up x across."""
    right = across(joints, skeleton)
    return normalize(cross(UP, right))


def mirror_joints(joints: Array, skeleton: Skeleton) -> Array:
    """Mirror joints (..., J, 3): x changes sign, and each joint takes the other side's place."""
    return joints[..., list(skeleton.mirror), :] * np.array([-1, 1, 1], joints.dtype)
