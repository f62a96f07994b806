"""The floor of a clip: under whatever supports the body."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from marey.motion.support import RADII

Array = NDArray[np.floating]
_FEET = [7, 8, 10, 11]
PERCENTILE = 2
"""Of the frames, in which the body may pass under the floor."""
LEAST_SUPPORTS, LEAST_EXTENT = 10, 1.5
"""Frames in which a foot stands, and metres that they cover in a direction, from which a floor's slope is fitted."""
LEAST_RISE, LARGEST_SLOPE = 0.02, 0.03
"""Metres that the floor of a capture rises over that extent for its tilt to be clear; and how steep it may be: more is
a slope that was walked on."""
_EXPLAINED = 0.7  # of the spread of the supports' heights, that is left on a tilted floor, at most
_STANDS = 0.15  # m/s of a joint that carries the body
_ROUNDS, _OUTLIER = 8, 0.02
_NEAR = (-0.3, 0.08)  # metres: bodies lie on flesh that radii do not know; higher is in the air


def levelled(joints: Array, fps: float = 20.0) -> Array:
    """The clip (T, 22, 3), its floor made level where the supports show clearly that the capture's tilts.

    The heights of standing supports are fitted as a plane, those far off it weighed down; the clip is sheared, which
    keeps what is upright upright.
    """
    places = _supports(joints, fps)
    if len(places) < LEAST_SUPPORTS:
        return joints
    slope, level, off = _plane(places)
    rise = np.ptp(places[:, [0, 2]] @ slope)
    if not (rise > LEAST_RISE and np.linalg.norm(slope) < LARGEST_SLOPE and off < _EXPLAINED * level):
        return joints
    out = joints.copy()
    out[..., 1] -= (joints[..., [0, 2]] - joints[0, 0, [0, 2]]) @ slope
    return out


def _supports(joints: Array, fps: float) -> Array:
    """Where standing feet touch the floor (N, 3): the lowest of their joints in each frame, while it does not move."""
    height = joints[:, _FEET, 1] - RADII[_FEET]
    lowest = np.array(_FEET)[height.argmin(axis=1)]
    frames = np.arange(len(joints) - 1)
    places, later = joints[frames, lowest[:-1]], joints[frames + 1, lowest[:-1]]
    still = np.linalg.norm((later - places)[:, [0, 2]], axis=1) * fps < _STANDS
    places[:, 1] -= RADII[lowest[:-1]]
    return places[still]


def _plane(places: Array) -> tuple[Array, float, float]:
    """Slope (2,) of the plane through most of the places, and how far they are off the level, and off the plane
    (medians, metres). Along directions in which they cover less than `LEAST_EXTENT` it has no slope."""
    across = places[:, [0, 2]] - places[:, [0, 2]].mean(axis=0)
    _, _, axes = np.linalg.svd(across, full_matrices=False)
    axes = axes[np.ptp(across @ axes.T, axis=0) >= LEAST_EXTENT]
    design = np.column_stack([across @ axes.T, np.ones(len(places))])
    solved, off = np.zeros(design.shape[1]), np.zeros(len(places))
    for _ in range(_ROUNDS):
        weights = np.sqrt(1 / (1 + (off / _OUTLIER) ** 2))
        solved = np.linalg.lstsq(design * weights[:, None], places[:, 1] * weights, rcond=None)[0]
        off = np.abs(places[:, 1] - design @ solved)
    level = np.abs(places[:, 1] - np.median(places[:, 1]))
    return solved[:-1] @ axes, float(np.median(level)), float(np.median(off))


def on_floor(joints: Array, rule: Literal["support", "feet", "file"]) -> Array:
    """The clip (T, 22, 3) with its floor at height 0.

    `support`: level (`levelled`), and no part of the body but for the lowest 2 % of the frames is lower than its radius
    over the floor, so that people lie, crawl and stand on their hands upon it; `feet`: the same for the joints of the
    feet alone; `file`: under the lowest part of the body where that is near height 0 of the file; else the floor is
    there, as under a leap that never lands.
    """
    out = np.array(joints, np.float64)
    if rule == "support":
        out = levelled(out)
    lowest = out[:, _FEET, 1] if rule == "feet" else out[..., 1] - RADII
    floor = np.percentile(lowest.min(axis=1), PERCENTILE)
    if rule != "file" or _NEAR[0] < floor < _NEAR[1]:
        out[..., 1] -= floor
    return out
