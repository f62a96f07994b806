"""How one pose stands: where it faces, and how high its root is over the floor."""

from __future__ import annotations

import numpy as np

from marey.motion.kinematics import facing, forward_kinematics
from marey.motion.rotations import Array
from marey.motion.skeleton import HUMANML3D, Skeleton
from marey.motion.support import clearance

FLOOR = 0.015
"""Height in metres of the lowest joint of a pose on another skeleton than that of 22 joints."""


def heading(rotations: Array, skeleton: Skeleton) -> float:
    """Return the heading of one pose (J, 4), radians from +Z."""
    x, _, z = facing(forward_kinematics(skeleton, rotations[None], np.zeros((1, 3))), skeleton)[0]
    return float(np.arctan2(x, z))


def standing_height(rotations: Array, skeleton: Skeleton) -> float:
    """Return the height of the root over the floor at which a pose (J, 4) lies or stands on it, metres."""
    joints = forward_kinematics(skeleton, rotations[None], np.zeros((1, 3)))
    if skeleton.name == HUMANML3D.name:
        return -float(clearance(joints)[0])
    return FLOOR - float(joints[0, :, 1].min())
