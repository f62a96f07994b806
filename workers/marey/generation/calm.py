"""A body that stands, of any motion."""

from __future__ import annotations

import random

import numpy as np
from numpy.typing import NDArray

from marey.motion.filters import smooth_seconds
from marey.posing.still import standing_still

Array = NDArray[np.floating]

CALM_S = 1.0
"""Seconds of the calmest part of a motion."""
_FEET = [7, 8, 10, 11]
"""Left and right ankle, left and right toes."""
BREATHES = 0.03
"""Metres by which a body that stands moves at most."""
LIFTED_M, DEEP_M = 0.06, 0.7
"""Metres of a foot that stands over the lowest place of its heel and its toes, at most, and of the hips over the feet,
at least."""


def calm(joints: Array, fps: float, rng: np.random.Generator) -> Array:
    """Return as many frames of a body that stands on both feet: the calmest second of a motion, to and fro, in place;
    of a motion without such a second, another body that stands still."""
    long = max(min(round(CALM_S * fps), len(joints) - 1), 2)
    stands = _on_both_feet(joints)
    upright = joints[:, 15, 1] - joints[:, [10, 11], 1].min(1)
    moved = np.linalg.norm(np.diff(joints, axis=0), axis=-1).max(1)
    costs = [moved[k : k + long - 1].sum() - 0.5 * upright[k : k + long].min() for k in range(len(joints) - long + 1)]
    planted = [stands[k : k + long].all() for k in range(len(joints) - long + 1)]
    if not any(planted):
        return standing_still(len(joints), random.Random(int(rng.integers(2**62))))  # noqa: S311
    first = int(np.argmin(np.where(planted, costs, np.inf)))
    part = smooth_seconds(joints[first : first + long].reshape(long, -1), 0.1, fps).reshape(long, -1, 3)
    mean = part.mean(0)
    part = mean + min(1.0, BREATHES / max(float(np.abs(part - mean).max()), 1e-6)) * (part - mean)
    to_and_fro = np.concatenate([part, part[-2:0:-1]])
    repeated = to_and_fro[np.arange(len(joints)) % len(to_and_fro)].copy()
    repeated[:, _FEET] = mean[_FEET]
    return repeated


def _on_both_feet(joints: Array) -> NDArray[np.bool_]:
    """Return True (T,) where heels and toes are on the floor, and the knees are not bent far."""
    feet = joints[:, _FEET, 1]
    lowest = np.percentile(feet, 2, axis=0).reshape(2, 2).min(axis=1)  # of the heels, and of the toes
    down = (feet - lowest.repeat(2) < LIFTED_M).all(axis=1)
    return np.asarray(down & (joints[:, 0, 1] - feet.min(1) > DEEP_M), np.bool_)
