"""The floor of a clip, below the parts that support the body."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from marey.data.part import FPS
from marey.motion.filters import smooth
from marey.motion.support import RADII, clearance

Array = NDArray[np.floating]
_FEET = [7, 8, 10, 11]
PERCENTILE = 2
"""Percentage of frames in which the body may be below the floor."""
LEAST_SUPPORTS, LEAST_EXTENT = 10, 1.5
"""Least number of frames with a standing foot, and their extent in metres, for fitting a floor's slope."""
LEAST_RISE, LARGEST_SLOPE = 0.02, 0.03
"""Least rise of a floor over that extent for a correction, metres, and largest slope: a steeper one was a real
slope."""
_EXPLAINED = 0.7  # largest remaining share of the spread of support heights after fitting a tilted floor
_STANDS = 0.15  # m/s, largest speed of a joint that carries the body
_ROUNDS, _OUTLIER = 8, 0.02
_FOLLOW = 0.05  # seconds, smoothing of a floor that follows the body
_NEAR = (-0.3, 0.08)  # metres: `RADII` ignore flesh under lying bodies; higher bodies are in the air


def levelled(joints: Array) -> Array:
    """Level the floor of a clip (T, 22, 3) if its supports clearly show a tilt.

    A plane is fitted robustly to the heights of standing supports. The clip is sheared, which keeps vertical directions
    vertical.
    """
    places = _supports(joints)
    if len(places) < LEAST_SUPPORTS:
        return joints
    slope, level, off = _plane(places)
    rise = np.ptp(places[:, [0, 2]] @ slope)
    if not (rise > LEAST_RISE and np.linalg.norm(slope) < LARGEST_SLOPE and off < _EXPLAINED * level):
        return joints
    out = joints.copy()
    out[..., 1] -= (joints[..., [0, 2]] - joints[0, 0, [0, 2]]) @ slope
    return out


def _supports(joints: Array) -> Array:
    """Contact points (N, 3) of standing feet: the lowest foot joint of each frame while it does not move."""
    height = joints[:, _FEET, 1] - RADII[_FEET]
    lowest = np.array(_FEET)[height.argmin(axis=1)]
    frames = np.arange(len(joints) - 1)
    places, later = joints[frames, lowest[:-1]], joints[frames + 1, lowest[:-1]]
    still = np.linalg.norm((later - places)[:, [0, 2]], axis=1) * FPS < _STANDS
    places[:, 1] -= RADII[lowest[:-1]]
    return places[still]


def _plane(places: Array) -> tuple[Array, float, float]:
    """Fit a plane robustly: slope (2,), and median distances of the places from their level and from the plane, metres.
    The slope is zero in directions with an extent below `LEAST_EXTENT`."""
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


def follow_floor(joints: Array) -> Array:
    """Move each frame of a clip (T, 22, 3) so that the body is on the floor.

    For files whose hips stay at one height, though the body crouches, lies or sits: what rises in them are the feet.
    """
    out = np.array(joints, np.float64)
    out[..., 1] -= smooth(clearance(out)[:, None], _FOLLOW * FPS)
    return out


def on_floor(joints: Array, rule: Literal["support", "feet", "file"]) -> Array:
    """Move a clip (T, 22, 3) so that its floor is at height 0.

    `support`: level (`levelled`), and joints are at least their radius above the floor except in the lowest 2 % of the
    frames, so that people lie, crawl and stand on their hands on it; `feet`: for the joints of the feet only, without
    radii and levelling; `file`: below the lowest part of the body if that is near height 0 of the file, otherwise at
    height 0, as for a leap without a landing.
    """
    out = np.array(joints, np.float64)
    if rule == "support":
        out = levelled(out)
    lowest = out[:, _FEET, 1] if rule == "feet" else out[..., 1] - RADII
    floor = np.percentile(lowest.min(axis=1), PERCENTILE)
    if rule != "file" or _NEAR[0] < floor < _NEAR[1]:
        out[..., 1] -= floor
    return out
