"""Drawn movements: a length, and a change of a body."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from marey.posing.standing import LEFT, RIGHT, StandingBody

Array = NDArray[np.floating]

SIDES = (LEFT, RIGHT)
BOTH = "both"


@dataclass(frozen=True)
class Gesture:
    """A drawn gesture.

    Attributes:
        seconds: its length, including the time standing before and after it.
        kinds: keys of the files `gestures*.toml` that apply to it.
        change: applies it to a body of that length.
        side: left, right, both or empty.
        times: number of bows.
        base: what is taken of a captured clip before the change, (T, 22, 3), or None if the clip does not do; without
            it, `seconds` of an idle.
        content: the action of the captured clips that it may be put onto, or empty for all clips of its kind.
        untrue: see `marey.data.spoken.spoken`.
        fills: the change fills a body of any length.
    """

    seconds: float
    kinds: tuple[str, ...]
    change: Callable[[StandingBody], None]
    side: str = ""
    times: int = 1
    base: Callable[[Any], Array | None] | None = None
    content: str = ""
    untrue: str = ""
    fills: bool = False
