"""Input checks shared by all metrics: one NaN row would otherwise come out as a score."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from marey.core.errors import InvalidInput

Array = NDArray[np.float64]
Numbers = NDArray[Any]
Integers = NDArray[np.int64]

# The networks' range. Squares and cubes of values within it stay finite in float64.
_LARGEST = float(np.finfo(np.float32).max)


def embeddings(name: str, values: Numbers | Sequence[float], *, axes: str = "ND") -> Array:
    """Validate one finite float64 array, with as many axes as `axes` has letters and none of them empty.

    Raises:
        InvalidInput: wrong shape, or a value that float32 does not hold (NaN, infinite, larger).
    """
    array = np.asarray(values, np.float64)
    if array.ndim != len(axes) or 0 in array.shape:
        wanted = f"({', '.join(axes)},)" if len(axes) == 1 else f"({', '.join(axes)})"
        raise InvalidInput(f"has the shape {array.shape}", where=name, hint=f"give {wanted}, none of them 0")
    broken = np.flatnonzero(~(np.abs(array) <= _LARGEST).reshape(len(array), -1).all(axis=1))
    if broken.size:
        raise InvalidInput(
            f"{broken.size} of {len(array)} rows hold NaN, infinite or too large values",
            where=f"{name}, row {broken[0]}",
            hint="look at the network or clip that made them: no metric is computed around a broken row",
        )
    return array


def pairs(first: Numbers, second: Numbers, *, names: tuple[str, str] = ("text", "motion")) -> tuple[Array, Array]:
    """Validate two arrays (N, D) whose rows correspond.

    Raises:
        InvalidInput: as `embeddings`, or different shapes.
    """
    one, other = embeddings(names[0], first), embeddings(names[1], second)
    if one.shape != other.shape:
        raise InvalidInput(
            f"the shapes {one.shape} and {other.shape} differ",
            where=", ".join(names),
            hint="give one row a pair in each, in the same order, from one joint space",
        )
    return one, other


def integers(name: str, values: Numbers, *, count: int | None = None) -> Integers:
    """Validate whole numbers (N,), as many as `count` if it is given.

    Raises:
        InvalidInput: wrong shape, or not integers.
    """
    array = np.asarray(values)
    if array.ndim != 1 or len(array) != (count or len(array)) or not np.issubdtype(array.dtype, np.integer):
        raise InvalidInput(
            f"has the shape {array.shape} and type {array.dtype}",
            where=name,
            hint=f"give {count or 'N'} integers, one a row",
        )
    return array.astype(np.int64)


def at_least(name: str, value: int, least: int, *, hint: str) -> None:
    """Validate that `value`, a size or a count, is at least `least`; raise InvalidInput otherwise."""
    if value < least:
        raise InvalidInput(f"{value} is too few, {least} are needed", where=name, hint=hint)
