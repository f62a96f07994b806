"""Detect broken captures: bodies that bend or jump impossibly."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from marey.motion.rotations import cross, normalize
from marey.posing.limbs import LEG_CHAINS

Array = NDArray[np.floating]

# Walks and dances reach 3,450 m/s^3, punches and sword strokes 9,800; a joint that jumps by 42 cm for one frame
# reaches the limit. Deep squats fold a foot by 148 degrees on some rigs, broken captures by 155 to 177.
LARGEST_JERK = 10_000.0  # m/s³
LARGEST_FOOT_FOLD = 150.0  # degrees between shank and foot
LEAST_KNEE = -15.0  # degrees; 0 is a straight leg, positive is bent as knees bend
FOLDED_KNEE = -160.0
"""Below this angle a knee is bent slightly beyond 180 degrees, as in squats on some rigs, not backward."""


def is_broken(joints: Array, fps: float) -> bool:
    """Return True if a motion has a jumping joint, a knee bent backward, or a foot folded against the shank.

    Args:
        joints: (T, 22, 3) metres, Y up.
        fps: frames a second.
    """
    joints = np.asarray(joints, np.float64)
    jerk = np.linalg.norm(np.diff(joints, 3, axis=0), axis=-1) * fps**3
    if jerk.max(initial=0.0) > LARGEST_JERK:
        return True
    left = normalize(joints[:, 1] - joints[:, 2])
    for hip, knee, ankle, toe in LEG_CHAINS:
        thigh, shank = normalize(joints[:, knee] - joints[:, hip]), normalize(joints[:, ankle] - joints[:, knee])
        foot = normalize(joints[:, toe] - joints[:, ankle])
        bend = np.arctan2(np.einsum("ti,ti->t", cross(thigh, shank), left), np.einsum("ti,ti->t", thigh, shank))
        fold = np.arccos(np.clip(np.einsum("ti,ti->t", shank, foot), -1, 1))
        degrees = np.degrees(bend)
        backward = ((degrees < LEAST_KNEE) & (degrees > FOLDED_KNEE)).any()
        if backward or np.degrees(fold.max()) > LARGEST_FOOT_FOLD:
            return True
    return False
