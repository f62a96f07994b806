"""Hands that meet: on a body whose bones are not those that a decoder drew, they would stop short of each other, or
pass through.

Where the wrists were decoded close to each other, they get that distance again, each moved by half of what is missing;
the elbows follow by two-bone inverse kinematics.
"""

from __future__ import annotations

import numpy as np

from marey.motion.body import STATURE, stature
from marey.motion.kinematics import facing
from marey.motion.legs import two_bone_knee
from marey.motion.rotations import Array, length, normalize
from marey.motion.skeleton import Skeleton

MEET, APART = 0.18, 0.30
"""Metres between wrists of a body of `STATURE`: nearer than the first hands meet, and from the second on they are left
alone."""


def wrist_distance(joints: Array, skeleton: Skeleton) -> Array:
    """Return the distance (T,) between the wrists of joints (T, J, 3), metres."""
    (*_, right), (*_, left) = arms(skeleton)
    return length(joints[:, right] - joints[:, left])


def arms(skeleton: Skeleton) -> tuple[tuple[int, int, int], tuple[int, int, int]]:
    """Return shoulder, elbow and wrist of the right arm and of the left one."""
    right, left = ((shoulder, *_two_below(skeleton, shoulder)) for shoulder in skeleton.facing[2:])
    return right, left


def _two_below(skeleton: Skeleton, shoulder: int) -> tuple[int, int]:
    elbow = skeleton.children[shoulder][0]
    return elbow, skeleton.children[elbow][0]


def join_hands(joints: Array, wanted: Array, skeleton: Skeleton) -> Array:
    """Return the motion (T, J, 3) with hands that meet as they were decoded; bones keep their lengths.

    Args:
        joints: (T, J, 3) metres.
        wanted: (T,) distance of the wrists, as decoded and scaled to the body, metres.
        skeleton: with known shoulders.
    """
    size = round(stature(skeleton) / STATURE, 3)
    near = np.clip((size * APART - wanted) / (size * (APART - MEET)), 0.0, 1.0)
    if not near.any():
        return joints
    share = near * near * (3.0 - 2.0 * near)
    both = arms(skeleton)
    right, left = (joints[:, wrist] for *_, wrist in both)
    apart = length(right - left)
    move = (0.5 * share * (wanted - apart))[:, None] * normalize(right - left)
    behind = -facing(joints, skeleton)
    joined = joints.copy()
    for (shoulder, elbow, wrist), way in zip(both, (1.0, -1.0), strict=True):
        arm = joints[:, [shoulder, elbow, wrist]]
        target = arm[:, 2] + way * move
        joined[:, elbow] = two_bone_knee(arm, arm[:, 0], target, behind)
        forearm = length(arm[:, 2] - arm[:, 1])[:, None]
        joined[:, wrist] = joined[:, elbow] + forearm * normalize(target - joined[:, elbow])
    return np.where((share > 0)[:, None, None], joined, joints)
