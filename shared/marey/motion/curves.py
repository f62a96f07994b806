"""Curves over time: smoothing that keeps the ends, curves through points, changes that fade in and out."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from marey.motion.filters import smooth, smootherstep
from marey.motion.rotations import Array


def smooth_open(values: Array, sigma: float) -> Array:
    """Return values (T, C) smoothed by a Gaussian of `sigma` frames; the first and the last stay as they are, since the
    motion continues beyond them by point reflection."""
    reach = min(int(3 * sigma + 0.5), len(values) - 1)
    if reach < 1:
        return values
    before = 2 * values[0] - values[reach:0:-1]
    after = 2 * values[-1] - values[-2 : -reach - 2 : -1]
    return smooth(np.concatenate([before, values, after]), min(sigma, reach / 3))[reach : reach + len(values)]


def through(frames: Array, values: Array, at: Array) -> Array:
    """Return a curve through values (n, C) at rising frames (n,), at other frames (T,): cubic, with continuous speed;
    straight on beyond the ends."""
    if len(frames) == 1:
        return np.repeat(values, len(at), axis=0)
    steps = np.diff(frames)[:, None]
    slopes = np.diff(values, axis=0) / steps
    inner = (slopes[:-1] * steps[1:] + slopes[1:] * steps[:-1]) / (steps[:-1] + steps[1:])
    ends = np.concatenate([slopes[:1], inner, slopes[-1:]])
    k = np.clip(np.searchsorted(frames, at, side="right") - 1, 0, len(steps) - 1)
    width = steps[k]
    t = (at - frames[k])[:, None] / width
    inside = (
        (1 + 2 * t) * (1 - t) ** 2 * values[k]
        + t * (1 - t) ** 2 * width * ends[k]
        + t**2 * (3 - 2 * t) * values[k + 1]
        + t**2 * (t - 1) * width * ends[k + 1]
    )
    before = values[0] + (at - frames[0])[:, None] * ends[0]
    after = values[-1] + (at - frames[-1])[:, None] * ends[-1]
    return np.where((at < frames[0])[:, None], before, np.where((at > frames[-1])[:, None], after, inside))


def hump(t: Array) -> Array:
    """Return 1 at t = 0, 0 from |t| = 1 on, with continuous speed and acceleration between."""
    return smootherstep(1 - np.minimum(np.abs(t), 1.0))


def fades(frames: NDArray[np.intp], values: Array, spans: Array, count: int) -> Array:
    """Return changes (count, C) that are `values` (n, C) at whole rising frames (n,) and fade within `spans` (n,)
    frames.

    Between two frames that are nearer to each other than their spans, the change passes from one to the other.
    """
    at = np.arange(count, dtype=np.float64)
    changes = np.zeros((count, values.shape[1]))
    first, last = frames[0], frames[-1]
    changes += np.where(at < first, hump((at - first) / spans[0]), 0.0)[:, None] * values[0]
    changes += np.where(at > last, hump((at - last) / spans[-1]), 0.0)[:, None] * values[-1]
    changes[frames] = values
    for k in range(len(frames) - 1):
        begin, end = int(frames[k]), int(frames[k + 1])
        inner = slice(begin + 1, end)
        if end - begin < spans[k] + spans[k + 1]:
            share = hump((at[inner] - begin) / (end - begin))[:, None]
            changes[inner] = share * values[k] + (1 - share) * values[k + 1]
        else:
            changes[inner] = hump((at[inner] - begin) / spans[k])[:, None] * values[k]
            changes[inner] += hump((at[inner] - end) / spans[k + 1])[:, None] * values[k + 1]
    return changes
