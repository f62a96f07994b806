"""Smoothing over time."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.lib.stride_tricks import as_strided

from marey.motion.rotations import Array


def smooth(values: Array, sigma: float, *, cut: float = 3.0) -> Array:
    """Gaussian filter over axis 0, ends repeated.

    Args:
        values: (T, C).
        sigma: standard deviation in frames; 0 changes nothing.
        cut: where the kernel ends, in standard deviations.
    """
    radius = int(cut * sigma + 0.5)
    if radius < 1:
        return values
    return _windows(values, radius) @ _kernel(sigma, radius)


def smooth_seconds(values: Array, seconds: float, fps: float) -> Array:
    """Gaussian filter over axis 0, ends repeated, of what is measured or drawn at any frame rate.

    `smooth` ends its kernel elsewhere and adds in another order, so the last bits of a motion say which of the two
    made it: neither can stand for the other.

    Args:
        values: (T, ...).
        seconds: standard deviation; under 0.3 frames it changes nothing.
        fps: frames a second.

    Returns:
        float64 (T, ...).
    """
    sigma = seconds * fps
    if sigma < 0.3 or len(values) < 2:
        return np.asarray(values, np.float64)
    radius = int(np.ceil(3 * sigma))
    kernel = np.exp(-0.5 * (np.arange(-radius, radius + 1) / sigma) ** 2)
    kernel /= kernel.sum()
    flat = np.asarray(values, np.float64).reshape(len(values), -1)
    padded = np.pad(flat, ((radius, radius), (0, 0)), mode="edge")
    columns = [np.convolve(padded[:, c], kernel, mode="valid") for c in range(flat.shape[1])]
    return np.stack(columns, axis=1).reshape(np.shape(values)).astype(np.float64)


def smooth_above(values: Array, sigma: float) -> Array:
    """Return a smooth curve (T,) that is nowhere below the values: their running maximum over three sigma, smoothed."""
    radius = int(3 * sigma + 0.5)
    if radius < 1 or not values.any():
        return values
    highest = _windows(values[:, None], radius).max(axis=2)
    return smooth(highest, sigma)[:, 0]


@lru_cache(maxsize=256)
def _kernel(sigma: float, radius: int) -> Array:
    """Return the weights (2 radius + 1,) of a Gaussian filter."""
    kernel = np.exp(-0.5 * (np.arange(-radius, radius + 1) / sigma) ** 2)
    return kernel / kernel.sum()


def _windows(values: Array, radius: int) -> Array:
    """Return the values (T, C) around each frame as (T, C, 2 radius + 1), ends repeated; not to be written to.

    `np.pad` and `sliding_window_view` take five times as long as the filter itself.
    """
    frames, columns = values.shape
    order = "F" if values.flags.fnc else "C"  # sums in the order of the memory: to the last bit as `np.pad` has it
    padded = np.empty((frames + 2 * radius, columns), values.dtype, order)
    padded[:radius] = values[0]
    padded[radius:-radius] = values
    padded[-radius:] = values[-1]
    across, down = padded.strides[1], padded.strides[0]
    return as_strided(padded, (frames, columns, 2 * radius + 1), (down, across, down), writeable=False)


def smoothstep(share: Array) -> Array:
    """Return 0 … 1 with no slope at both ends, for a share from 0 to 1."""
    return share * share * (3 - 2 * share)


def smootherstep(share: Array) -> Array:
    """Return 0 … 1 with no slope and no acceleration at both ends, for a share from 0 to 1."""
    return share**3 * (share * (6 * share - 15) + 10)
