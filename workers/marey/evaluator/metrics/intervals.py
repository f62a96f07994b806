"""Intervals over repeats, in the usual form of the field. For two runs on the same prompts see `marey.measures`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from marey.measures.inputs import Numbers, at_least, embeddings

T = TypeVar("T")


@dataclass(frozen=True)
class Interval:
    """A mean over repeats.

    Attributes:
        mean: of the repeats.
        half_width: of the 95 % interval: 1.96 · std / √n with the population's standard deviation.
        n: repeats.
    """

    mean: float
    half_width: float
    n: int


def repeated(values: Sequence[float] | Numbers) -> Interval:
    """Return mean and 95 % interval of repeats, as the T2M evaluator reports them over 20.

    The interval covers the variation of the repeats: if they redraw only pools, not that of another generation or
    training.

    Args:
        values: (n,) one number per repeat, 2 or more.

    Raises:
        InvalidInput: not finite, or a single repeat, whose interval would have width 0.
    """
    array = embeddings("values", values, axes="n")
    at_least("values", len(array), 2, hint="one repeat has no interval")
    return Interval(float(array.mean()), float(1.96 * array.std() / np.sqrt(len(array))), len(array))


def redraw(metric: Callable[[np.random.Generator], T], *, repeats: int = 20, seed: int) -> tuple[T, ...]:
    """Call `metric` once per repeat, each time with an independent generator.

    The generators are a function of `seed` and the repeat only, so that two runs draw the same pools, and more repeats
    begin with the same ones.

    Raises:
        InvalidInput: no repeats.
    """
    at_least("repeats", repeats, 1, hint="repeat at least once")
    return tuple(metric(np.random.default_rng(child)) for child in np.random.SeedSequence(seed).spawn(repeats))
