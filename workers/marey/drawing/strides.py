"""A few strides ahead or back, from standing to standing."""

from __future__ import annotations

import random

import numpy as np

from marey.drawing.footsteps import Footstep, Manner, stepped, swing_arms_with
from marey.drawing.gesture import Gesture
from marey.posing.limbs import FPS
from marey.posing.standing import StandingBody, eased

_PACES = {"slow": (0.8, 0.9), "": (0.52, 0.58), "fast": (0.4, 0.44)}
"""Seconds from one stride to the next, by pace."""
_AHEAD, _BACK = (0.56, 0.64), (0.44, 0.5)
"""Metres of a stride ahead, and of one back."""
_SWINGS = 0.88
"""Share of the time to the next stride in which a foot is in the air."""
_FOLLOWS_S = 0.2
"""Seconds over which the hips follow the feet."""


def strides(
    rng: random.Random,
    count: int,
    *,
    back: bool = False,
    pace: str = "",
    waits: tuple[float, float],
    metres: float | None = None,
) -> Gesture:
    """A body that stands, takes some strides, and stands: the last one brings a foot beside the other.

    Args:
        rng: decides everything that is not given.
        count: of the strides, 2 or more.
        back: they go back.
        pace: slow, fast or empty.
        waits: seconds that the body stands before it and after it.
        metres: that it goes; None = as far as it comes.
    """
    interval, first = rng.uniform(*_PACES[pace]), rng.randint(0, 1)
    far = -rng.uniform(*_BACK) if back else rng.uniform(*_AHEAD)
    if metres is not None:
        far = (-metres if back else metres) / (count - 1)
    steps = [
        Footstep(
            (first + number) % 2,
            waits[0] + number * interval,
            _SWINGS * interval,
            forward=far * min(number + 1, count - 1),
        )
        for number in range(count)
    ]
    end = waits[0] + count * interval
    manner = Manner(rng.uniform(0.05, 0.06), rng.uniform(12, 18) if back else rng.uniform(24, 32), 0.025, 0.0)
    stoop, swing = (
        rng.uniform(-2, 1) if back else rng.uniform(1, 4),
        rng.uniform(8, 12) if back else rng.uniform(16, 22),
    )

    def change(body: StandingBody) -> None:
        time = np.arange(len(body.joints)) / FPS
        moving = eased((time - waits[0] + 0.2) / 0.5) * (1 - eased((time - end + 0.3) / 0.6))
        body.lean(stoop * moving, "left")
        swing_arms_with(body, steps, swing)
        body.joints[:] = stepped(body.joints, steps, manner, _FOLLOWS_S)

    return Gesture(end + waits[1], ("walk-backward" if back else "walk",), change, times=count)
