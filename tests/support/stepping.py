"""A stepping person: feet laid down on the floor first, legs after them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from marey.motion.legs import two_bone_knee
from marey.motion.pose import solve_pose
from marey.motion.skeleton import HUMANML3D
from tests.support.motions import drift

HIPS, KNEES, ANKLES, TOES = [1, 2], [4, 5], [7, 8], [10, 11]


def stepping(fps: float = 20.0, seconds: float = 6.0) -> NDArray[np.float64]:
    """Joints of a person that walks straight on, whose feet stand still on the floor while they stand, knees bent.

    Feet are laid down first; the legs follow by two-bone inverse kinematics.
    """
    time = np.arange(round(seconds * fps)) / fps
    rest = HUMANML3D.rest.astype(float)
    joints = np.tile(rest, (len(time), 1, 1))
    joints[..., 1] -= 0.08  # knees bend
    joints[..., 2] += (1.0 * time)[:, None]
    for side, (ankle, toe, phase) in enumerate(((7, 10, 0.0), (8, 11, 0.5))):
        turns = time + phase
        swing = np.clip((turns % 1 - 0.6) / 0.4, 0, 1)  # stands for 0.6 s of each second
        forward = np.floor(turns) + (3 * swing**2 - 2 * swing**3) - phase - 0.3
        lift = 0.12 * np.sin(np.pi * swing) ** 2
        for j in (ankle, toe):
            joints[:, j] = rest[j] + np.stack([0 * time, lift, forward + 0.6], axis=1)
        hip, knee = HIPS[side], KNEES[side]
        leg = np.tile(rest[[hip, knee, ankle]], (len(time), 1, 1))
        joints[:, knee] = two_bone_knee(leg, joints[:, hip], joints[:, ankle], np.tile([0, 0, 1.0], (len(time), 1)))
    return joints


def sliding(amount: float = 0.02, seed: int = 0) -> NDArray[np.float64]:
    """The same with feet that wander, the legs following, as generated ones do."""
    joints = stepping()
    slide = drift(seed, len(joints), 6, amount).reshape(-1, 2, 3) * [1, 0.3, 1]
    for side in range(2):
        joints[:, [KNEES[side], ANKLES[side], TOES[side]]] += slide[:, side, None]
    return solve_pose(joints, HUMANML3D, measure=False).joints
