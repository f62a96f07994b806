"""Physical quality of a motion, without labels: foot skate, jerk, bone drift, floor penetration."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from marey.checks.kinematics import TOES, Array
from marey.motion.kinematics import bone_lengths
from marey.motion.skeleton import HUMANML3D

SKATE_HEIGHT = 0.05
SKATE_SPEED = 0.5


@dataclass(frozen=True)
class Quality:
    """Numbers of one motion.

    Attributes:
        skate: share of frames with a toe under 5 cm and faster than 0.5 m/s.
        jerk: mean third derivative of the joints, metres a second cubed.
        bone_drift: mean absolute deviation of bone lengths from their median over time, metres.
        penetration: deepest joint under the floor (y = 0), metres, 0 or more.
    """

    skate: float
    jerk: float
    bone_drift: float
    penetration: float


def quality(joints: Array, fps: float) -> Quality:
    """Measure a motion (T >= 4, 22, 3), floor at y = 0."""
    joints = np.asarray(joints, np.float64)
    toes = joints[:, list(TOES)]
    speed = np.linalg.norm(np.diff(toes, axis=0), axis=-1) * fps
    low = np.minimum(toes[1:, :, 1], toes[:-1, :, 1]) < SKATE_HEIGHT
    bones = bone_lengths(joints, HUMANML3D)[:, 1:]
    return Quality(
        skate=float(((speed > SKATE_SPEED) & low).any(axis=1).mean()),
        jerk=float(np.linalg.norm(np.diff(joints, 3, axis=0), axis=-1).mean() * fps**3),
        bone_drift=float(np.abs(bones - np.median(bones, axis=0)).mean()),
        penetration=float(max(0.0, -joints[..., 1].min())),
    )
