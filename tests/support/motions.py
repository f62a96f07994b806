"""Motion drawn at random: smooth, within what joints do, on bones of constant length."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from marey.motion.filters import smooth
from marey.motion.rotations import from_rotvec
from marey.motion.skeleton import HUMANML3D, Skeleton

# Standard deviation in radians of the joints that turn any way; the others' twist cannot be seen in positions.
BALL = {"pelvis": 0.8, "L_hip": 0.6, "R_hip": 0.6, "spine3": 0.3, "L_shoulder": 0.7, "R_shoulder": 0.7, "neck": 0.2}


def drift(seed: int, frames: int, columns: int, scale: float, fps: float = 20.0) -> NDArray[np.float64]:
    """Smooth noise (T, columns) of about half a hertz with the given standard deviation."""
    noise = smooth(np.random.default_rng(seed).normal(size=(frames + 80, columns)), 0.3 * fps)[40:-40]
    return scale * noise / max(float(noise.std()), 1e-9)


def dancer(
    seed: int = 0, frames: int = 80, skeleton: Skeleton = HUMANML3D
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Rotations (T, J, 4) and root (T, 3) of a person that turns, sways and bends knees and elbows."""
    vectors = np.zeros((frames, len(skeleton), 3))
    for k, (name, scale) in enumerate(BALL.items()):
        vectors[:, skeleton.index(name)] = drift(10 * seed + k, frames, 3, scale)
    bends = 0.9 + drift(10 * seed + 8, frames, 4, 0.4)
    bends = np.clip(bends, 0.05, 2.2)
    vectors[:, skeleton.index("L_knee"), 0], vectors[:, skeleton.index("R_knee"), 0] = bends[:, 0], bends[:, 1]
    vectors[:, skeleton.index("L_elbow"), 1], vectors[:, skeleton.index("R_elbow"), 1] = -bends[:, 2], bends[:, 3]
    root = np.array([0.0, 0.95, 0.0]) + drift(10 * seed + 9, frames, 3, 0.2)
    return from_rotvec(vectors), root
