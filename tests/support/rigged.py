"""Motion of SnapMoGen's rig, drawn at random."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from marey.motion.rotations import about, from_rotvec, multiply, rotate
from marey.motion.skeleton import SNAPMOGEN
from tests.support.motions import drift

Array = NDArray[np.floating]


def rigged(seed: int = 0, frames: int = 60, turns: float = 0.0) -> tuple[Array, Array]:
    """Rotations (T, 24, 4) and root (T, 3) in metres of a figure that sways, walks off along +Z and may spin."""
    vectors = drift(seed, frames, 72, 0.2, fps=30.0).reshape(frames, 24, 3)
    vectors[:, 0] *= 0.5
    rotations = from_rotvec(vectors)
    root = np.array([0.0, 0.5, 0.0]) + drift(seed + 1, frames, 3, 0.03, fps=30.0)
    root[:, 2] += np.linspace(0.0, frames / 60, frames)
    turn = about("Y", np.linspace(0.0, 2 * np.pi * turns, frames))
    rotations[:, 0] = multiply(turn, rotations[:, 0])
    return rotations, rotate(turn, root)


def mirrored(rotations: Array, root: Array) -> tuple[Array, Array]:
    """The same motion with left and right exchanged."""
    return rotations[:, list(SNAPMOGEN.mirror)] * [1, 1, -1, -1], root * [-1, 1, 1]
