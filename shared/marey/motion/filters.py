"""Smoothing over time."""

from __future__ import annotations

import numpy as np

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
    kernel = np.exp(-0.5 * (np.arange(-radius, radius + 1) / sigma) ** 2)
    padded = np.pad(values, ((radius, radius), (0, 0)), mode="edge")
    return np.lib.stride_tricks.sliding_window_view(padded, len(kernel), axis=0) @ (kernel / kernel.sum())


def smooth_above(values: Array, sigma: float) -> Array:
    """Return a smooth curve (T,) that is nowhere below the values: their running maximum over three sigma, smoothed."""
    radius = int(3 * sigma + 0.5)
    if radius < 1 or not values.any():
        return values
    padded = np.pad(values, radius, mode="edge")
    highest = np.lib.stride_tricks.sliding_window_view(padded, 2 * radius + 1).max(axis=1)
    return smooth(highest[:, None], sigma)[:, 0]


def smoothstep(share: Array) -> Array:
    """Return 0 … 1 with no slope at both ends, for a share from 0 to 1."""
    return share * share * (3 - 2 * share)


def smootherstep(share: Array) -> Array:
    """Return 0 … 1 with no slope and no acceleration at both ends, for a share from 0 to 1."""
    return share**3 * (share * (6 * share - 15) + 10)
