"""Grades: numbers from 0 to 1, and 0.5 where a measure is exactly at the bound of a definition."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from marey.selector.motion import Bool

SIDES = ("left", "right")


def least(value: float, bound: float, margin: float) -> float:
    """Return 0.5 at the bound, 1 from a margin over it on, 0 from a margin under it on."""
    return float(np.clip(0.5 + (value - bound) / (2 * margin), 0, 1))


def most(value: float, bound: float, margin: float) -> float:
    """Return 0.5 at the bound, 1 from a margin under it on, 0 from a margin over it on."""
    return least(-value, -bound, margin)


def share(mask: Bool) -> float:
    """Return the share of frames of a mask; 0 of none."""
    return float(np.mean(mask)) if len(mask) else 0.0


def best(grades: Sequence[float]) -> float:
    """Return the largest grade; 0 of none."""
    return max(grades, default=0.0)


def every(mask: Bool) -> Bool:
    """(T,) True where all columns of a mask (T, K) are."""
    return np.asarray(mask.all(axis=1), np.bool_)


def some(mask: Bool) -> Bool:
    """(T,) True where any column of a mask (T, K) is."""
    return np.asarray(mask.any(axis=1), np.bool_)


def of_side(values: Sequence[float], side: str) -> float:
    """Return the value of the hand or foot asked for; the larger one of either, the smaller one of both."""
    if side == "both":
        return float(min(values))
    return float(values[SIDES.index(side)] if side in SIDES else max(values))
