"""A few strides ahead or back, from standing to standing."""

from __future__ import annotations

import random
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from marey.drawing.footsteps import Footstep, Manner, stepped, swing_arms_with
from marey.drawing.gesture import Gesture
from marey.posing.limbs import FPS
from marey.posing.standing import StandingBody, eased

_PACES = {"slow": (0.8, 0.9), "": (0.52, 0.58), "fast": (0.4, 0.44), "tiny": (0.42, 0.48), "tiny-slow": (0.55, 0.6)}
"""Seconds from one stride to the next, by pace."""
_AHEAD, _BACK = (0.56, 0.64), (0.44, 0.5)
"""Metres of a stride ahead, and of one back."""
_SINGLE = 0.52, 0.6
"""The same of a single one back."""
_SWINGS = 0.88
"""Share of the time to the next stride in which a foot is in the air."""
_FOLLOWS_S = 0.2
"""Seconds over which the hips follow the feet."""


_FORMS: Mapping[str, Mapping[str, float]] = {
    "waddle": {"lift": 0.05, "heel": 8.0, "sway": 0.06},
    "shuffle": {"lift": 0.026, "heel": 6.0, "sway": 0.02},
}
_ROCKS = 7.0
"""Degrees by which a waddling trunk leans over the foot that stands."""


def strides(
    rng: random.Random,
    count: int,
    *,
    back: bool = False,
    pace: str = "",
    waits: tuple[float, float],
    metres: float | None = None,
    size: float = 1.0,
    form: str = "",
) -> Gesture:
    """A body that stands, takes some strides, and stands: the last one brings a foot beside the other.

    Args:
        rng: decides everything that is not given.
        count: of the strides; the foot of a single one is followed by the other.
        back: they go back.
        pace: slow, fast, tiny or tiny-slow for those of tiny steps, or empty.
        waits: seconds that the body stands before it and after it.
        metres: that it goes; None = as far as it comes.
        size: factor of the length of a stride of which no metres are given.
        form: waddle, the body rocks over each foot; shuffle, the feet are hardly lifted; or empty.
    """
    single, count = count == 1, max(count, 2)
    interval, first = rng.uniform(*_PACES[pace]), rng.randint(0, 1)
    far = -rng.uniform(*(_SINGLE if single else _BACK)) if back else rng.uniform(*_AHEAD)
    far *= size
    if metres is not None:
        far = (-metres if back else metres) / (count - 1)
    steps = [
        Footstep((first + k) % 2, waits[0] + k * interval, _SWINGS * interval, forward=far * min(k + 1, count - 1))
        for k in range(count)
    ]
    end = waits[0] + count * interval
    manner, stoop, swing = _manner(rng, form, back=back)

    def change(body: StandingBody) -> None:
        time = np.arange(len(body.joints)) / FPS
        moving = eased((time - waits[0] + 0.2) / 0.5) * (1 - eased((time - end + 0.3) / 0.6))
        body.lean(stoop * moving, "left")
        swing_arms_with(body, steps, swing)
        if form == "waddle":
            share = np.sin(np.pi * (time - waits[0]) / interval) * moving
            body.lean((-1.0 if first else 1.0) * _ROCKS * share, "forward")
        body.joints[:] = stepped(body.joints, steps, manner, _FOLLOWS_S)

    return Gesture(end + waits[1], ("walk-backward" if back else "walk",), change, times=1 if single else count)


def _manner(rng: random.Random, form: str, *, back: bool) -> tuple[Manner, float, float]:
    """Return how strides are made, and degrees by which the trunk leans and the arms swing; see `strides`."""
    manner = Manner(rng.uniform(0.05, 0.06), rng.uniform(12, 18) if back else rng.uniform(24, 32), 0.025, 0.0)
    stoop = rng.uniform(-2, 1) if back else rng.uniform(1, 4)
    swing = rng.uniform(8, 12) if back else rng.uniform(16, 22)
    return (replace(manner, **_FORMS[form]), stoop, 0.5 * swing) if form else (manner, stoop, swing)
