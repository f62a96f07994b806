"""A body that stands, of any motion."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from marey.checks.kinematics import smooth

Array = NDArray[np.floating]

CALM_S = 1.0
"""Seconds of the calmest part of a motion."""
BREATHES = 0.03
"""Metres by which a body that stands moves at most."""


def calm(joints: Array, fps: float) -> Array:
    """Return as many frames of a body that stands: the calmest second of a motion, to and fro, in place."""
    long = max(min(round(CALM_S * fps), len(joints) - 1), 2)
    upright = joints[:, 15, 1] - joints[:, [10, 11], 1].min(1)
    moved = np.linalg.norm(np.diff(joints, axis=0), axis=-1).max(1)
    costs = [moved[k : k + long - 1].sum() - 0.5 * upright[k : k + long].min() for k in range(len(joints) - long + 1)]
    first = int(np.argmin(costs))
    part = smooth(joints[first : first + long].reshape(long, -1), 0.1, fps).reshape(long, -1, 3)
    mean = part.mean(0)
    part = mean + min(1.0, BREATHES / max(float(np.abs(part - mean).max()), 1e-6)) * (part - mean)
    to_and_fro = np.concatenate([part, part[-2:0:-1]])
    repeated = to_and_fro[np.arange(len(joints)) % len(to_and_fro)].copy()
    repeated[:, [7, 8, 10, 11]] = mean[[7, 8, 10, 11]]
    return repeated
