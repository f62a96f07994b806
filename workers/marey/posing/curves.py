"""Curves through points, and curves without their corners."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from marey.motion.filters import smooth
from marey.motion.rotations import normalize

Array = NDArray[np.floating]

CUT = 4.0
"""Standard deviations at which the kernel of `blurred` ends."""


def monotone(times: Sequence[float] | Array, points: Array | Sequence[Sequence[float]], at: Array) -> Array:
    """Path (T, K) through points (n, K) by monotone cubics; beyond the ends it is held.

    Between two points it stays between them, and where the direction changes it has no slope (Fritsch and Butland
    1984, doi 10.1137/0905021, as `scipy.interpolate.PchipInterpolator`, which is not at hand where motions are made).

    Args:
        times: (n,) seconds of the points, increasing; two or more.
        points: (n, K).
        at: (T,) seconds.
    """
    x, y = np.asarray(times, np.float64), np.asarray(points, np.float64)
    steps = np.diff(x)[:, None]
    slopes = np.diff(y, axis=0) / steps
    ends = _slopes(steps, slopes)
    k = np.clip(np.searchsorted(x, at, side="right") - 1, 0, len(steps) - 1)
    step = steps[k]
    share = ((np.clip(at, x[0], x[-1]) - x[k]) / step[:, 0])[:, None]
    begin, end = (1 + 2 * share) * (1 - share) ** 2, share**2 * (3 - 2 * share)
    leave, arrive = share * (1 - share) ** 2, share**2 * (share - 1)
    return begin * y[k] + end * y[k + 1] + step * (leave * ends[k] + arrive * ends[k + 1])


def _slopes(steps: Array, slopes: Array) -> Array:
    """Slopes (n, K) at the points: weighted harmonic means of those of the lines (n - 1, K) on both sides."""
    if len(steps) == 1:
        return np.repeat(slopes, 2, axis=0)
    before, after = slopes[:-1], slopes[1:]
    low, high = 2 * steps[1:] + steps[:-1], steps[1:] + 2 * steps[:-1]
    turns = before * after <= 0
    safe = [np.where(turns, 1.0, each) for each in (before, after)]
    inner = np.where(turns, 0.0, (low + high) / (low / safe[0] + high / safe[1]))
    first = _end_slope(steps[0], steps[1], slopes[0], slopes[1])
    last = _end_slope(steps[-1], steps[-2], slopes[-1], slopes[-2])
    return np.concatenate([first[None], inner, last[None]])


def _end_slope(step: Array, next_step: Array, slope: Array, next_slope: Array) -> Array:
    """Slope (K,) at an end, by three points, within what keeps the curve monotone."""
    found = ((2 * step + next_step) * slope - step * next_slope) / (step + next_step)
    found = np.where(np.sign(found) != np.sign(slope), 0.0, found)
    steep = (np.sign(slope) != np.sign(next_slope)) & (np.abs(found) > 3 * np.abs(slope))
    return np.where(steep, 3 * slope, found)


def closed(points: Array | Sequence[Sequence[float]], phase: Array) -> Array:
    """Smooth closed path (T, K) by the periodic cubic spline through points (n, K), n of 3 or more, at even parts of a
    round; `phase` (T,) counts rounds."""
    y = np.asarray(points, np.float64)
    count = len(y)
    ring = 4 * np.eye(count) + np.roll(np.eye(count), 1, axis=1) + np.roll(np.eye(count), -1, axis=1)
    bends = np.linalg.solve(ring, 6 * (np.roll(y, -1, axis=0) - 2 * y + np.roll(y, 1, axis=0)))
    at = (phase % 1.0) * count
    k = np.minimum(at.astype(int), count - 1)
    x, n = (at - k)[:, None], (k + 1) % count
    return (1 - x) * y[k] + x * y[n] + ((1 - x) ** 3 - (1 - x)) / 6 * bends[k] + (x**3 - x) / 6 * bends[n]


def blurred(values: Array, sigma: float) -> Array:
    """Gaussian filter over axis 0 of values (T, …), ends repeated; `sigma` in frames."""
    return smooth(values.reshape(len(values), -1), sigma, cut=CUT).reshape(values.shape)


SPREADS = 200
"""Rounds at most in which a fast turn is spread over the frames before and after it."""


def turning_evenly(directions: Array, most: float) -> Array:
    """Unit vectors (T, 3) that go the same way as others and turn by at most so many radians from one to the next: a
    faster turn begins earlier and ends later. They are returned themselves if none is faster."""
    before, after = directions[:-1], directions[1:]
    turns = np.arccos(np.clip((before * after).sum(-1), -1.0, 1.0))
    if turns.max(initial=0.0) <= most:
        return directions
    spread = turns.copy()
    for _ in range(SPREADS):
        over = np.maximum(spread - most, 0.0)
        spread -= over
        shared = np.concatenate([over[:1], over, over[-1:]]) / 2  # beyond the ends it comes back
        spread += shared[:-2] + shared[2:]
    along, at = (np.concatenate([[0.0], np.cumsum(each)]) for each in (turns, spread))
    k = np.clip(np.searchsorted(along, at, side="right") - 1, 0, len(turns) - 1)
    turn = np.maximum(turns[k], 1e-9)
    share = np.clip((at - along[k]) / turn, 0.0, 1.0)
    weights = (np.sin((1 - share) * turn) / np.sin(turn), np.sin(share * turn) / np.sin(turn))
    return normalize(weights[0][:, None] * before[k] + weights[1][:, None] * after[k])
