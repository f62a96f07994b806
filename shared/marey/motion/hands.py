"""Hands that meet, and arms that stay out of the body: a decoder knows neither the bones of the body nor that it is
solid.

Where the wrists were decoded close to each other, they get that distance again, each moved by half of what is missing;
forearms are moved out of the trunk, the head and the thighs. The elbows follow by two-bone inverse kinematics.
"""

from __future__ import annotations

import numpy as np

from marey.motion.body import STATURE, stature
from marey.motion.capsules import CAPSULES, SIDES, ends_of, nearest_on_segments
from marey.motion.filters import smooth
from marey.motion.kinematics import facing
from marey.motion.legs import two_bone_knee
from marey.motion.rotations import Array, length, normalize
from marey.motion.skeleton import HUMANML3D, Skeleton

MEET, APART = 0.18, 0.30
"""Metres between wrists of a body of `STATURE`: nearer than the first hands meet, and from the second on they are left
alone."""
ROUNDS, PASSES_S, MORE = 5, 0.08, 1.3
"""Times that an arm is moved out of the body, the standard deviation of the filter that this passes, seconds, and the
factor by which it makes up for what the filter takes."""
NEAREST, FARTHEST = 0.4, 0.12
"""Part of a forearm from the elbow on that is moved by its wrist, and metres that a wrist is moved at once."""


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
        moved = _with_wrist(joints[:, [shoulder, elbow, wrist]], way * move, behind)
        joined[:, elbow], joined[:, wrist] = moved
    return np.where((share > 0)[:, None, None], joined, joints)


def _with_wrist(arm: Array, move: Array, behind: Array) -> tuple[Array, Array]:
    """Return elbow and wrist (T, 3) of an arm (T, 3, 3) whose wrist moves by (T, 3) as far as its bones let it."""
    target = arm[:, 2] + move
    elbow = two_bone_knee(arm, arm[:, 0], target, behind)
    forearm = length(arm[:, 2] - arm[:, 1])[:, None]
    return elbow, elbow + forearm * normalize(target - elbow)


def clear_arms(joints: Array, skeleton: Skeleton, fps: float) -> Array:
    """Return the motion (T, J, 3) with forearms that stay out of trunk, head and thighs; bones keep their lengths.

    Bodies of other joints than those of HumanML3D are returned as they are.

    Args:
        joints: (T, J, 3) metres.
        skeleton: of the joints.
        fps: frames a second.
    """
    if skeleton.joint_names != HUMANML3D.joint_names:
        return joints
    size, behind, cleared = stature(skeleton) / STATURE, -facing(joints, skeleton), joints.copy()
    for side, (shoulder, elbow, wrist) in zip(("R_", "L_"), arms(skeleton), strict=True):
        arm, move = joints[:, [shoulder, elbow, wrist]], np.zeros((len(joints), 3))
        for _ in range(ROUNDS):
            push = _pushed_out(cleared, f"{side}forearm", size)
            if not push.any():
                break
            move = move + MORE * smooth(push, PASSES_S * fps)
            cleared[:, elbow], cleared[:, wrist] = _with_wrist(arm, move, behind)
    return cleared


def _pushed_out(joints: Array, forearm: str, size: float) -> Array:
    """Return how far (T, 3) a wrist has to move so that its forearm leaves what it is in; zero where it is in
    nothing."""
    (begin, end), radius = ends_of(forearm), CAPSULES[forearm][2]
    push = np.zeros((len(joints), 3))
    for name in ("trunk", "head", *(f"{side}thigh" for side in SIDES)):
        other = ends_of(name)
        ours, theirs = nearest_on_segments(*(joints[:, joint] for joint in (begin, end, *other)))
        near = joints[:, begin] + ours[:, None] * (joints[:, end] - joints[:, begin])
        away = near - (joints[:, other[0]] + theirs[:, None] * (joints[:, other[1]] - joints[:, other[0]]))
        depth = size * (radius + CAPSULES[name][2]) - length(away)
        share = np.maximum(depth, 0.0) / np.maximum(ours, NEAREST)
        push += np.minimum(share, FARTHEST)[:, None] * normalize(away)
    return push
