"""Trend test for a series of samples: a straight line through block means, with a 95 % interval."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

MIN_BLOCKS = 4


@dataclass(frozen=True)
class Trend:
    """Units an hour."""

    mean: float
    slope: float
    interval: float
    """Half of the 95 % interval around the slope."""

    def verdict(self, unit: str, *, negligible: float) -> str:
        """The trend in words.

        Args:
            negligible: units an hour that are called flat whether chance or not.
        """
        if self.slope - self.interval > negligible:
            return f"grows by {self.slope:.3g} {unit}/h"
        return "flat" if self.slope + self.interval > -negligible else f"shrinks by {-self.slope:.3g} {unit}/h"


def fit(seconds: NDArray[np.float64], values: NDArray[np.float64], *, block: float = 30.0) -> Trend:
    """The least-squares line through the means of blocks of `block` seconds.

    Neighbouring samples of one process are nearly the same number: taken one by one they would make the interval far
    too narrow. Means of half a minute are as good as independent where load comes and goes in seconds.

    Args:
        seconds: (n,) when each sample was taken.
        values: (n,) the samples.

    Raises:
        ValueError: fewer than four blocks.
    """
    numbers = np.floor((seconds - seconds[0]) / block).astype(int)
    blocks = np.unique(numbers)
    if len(blocks) < MIN_BLOCKS:
        raise ValueError(f"{len(blocks)} blocks of {block:g} s are too few for a slope: at least {MIN_BLOCKS}")
    hours = np.array([seconds[numbers == b].mean() for b in blocks]) / 3600
    means = np.array([values[numbers == b].mean() for b in blocks])
    centred = hours - hours.mean()
    spread = float(centred @ centred)
    slope = float(centred @ means) / spread
    residuals = means - means.mean() - slope * centred
    freedom = len(blocks) - 2
    error = float(np.sqrt(residuals @ residuals / freedom / spread))
    return Trend(float(values.mean()), slope, _student(freedom) * error)


def _student(freedom: int) -> float:
    """The 97.5 % quantile of Student's t, to two decimals from two degrees of freedom on."""
    small = {2: 4.30, 3: 3.18, 4: 2.78, 5: 2.57, 6: 2.45, 7: 2.36, 8: 2.31, 9: 2.26}
    return small.get(freedom, 1.96 + 2.45 / freedom)
