"""Stairs, up and down, step over step: each foot stands on every other tread, and both end on the last one."""

from __future__ import annotations

import random
from dataclasses import dataclass

import numpy as np

from marey.drawing.footsteps import Footstep, Manner, stepped, swing_arms_with
from marey.drawing.gesture import Gesture
from marey.posing.limbs import FPS
from marey.posing.standing import NECK, StandingBody, eased

_PACES = {"slow": (0.86, 0.98), "": (0.56, 0.64), "fast": (0.36, 0.4)}
"""Seconds from one tread to the next, by pace."""
_RISE, _TREAD = 0.17, 0.285
"""Metres that a tread is higher than the one below, and is deep: who goes up and comes back down is on the same
stairs."""
_LONGEST_S = 8.0
"""Seconds of the way at most."""
_SWINGS = 0.85
"""Share of the time to the next step in which a foot is in the air."""
_TOES = [10, 11]


@dataclass(frozen=True)
class Flight:
    """Wishes for a way over stairs.

    Attributes:
        stairs: how many.
        down: downward; it begins high up, and ends on the floor.
        pace: slow, fast or empty.
    """

    stairs: int
    down: bool = False
    pace: str = ""


def walk_stairs(rng: random.Random, flight: Flight, waits: tuple[float, float]) -> Gesture:
    """A body that stands, goes up or down some stairs, and stands with both feet on the last tread.

    Args:
        rng: decides everything that is not given.
        flight: what it is like.
        waits: seconds that the body stands before it and after it.
    """
    down, count = flight.down, flight.stairs
    interval = min(rng.uniform(*_PACES[flight.pace]), _LONGEST_S / (count + 1))
    rise, tread, first = _RISE, _TREAD, rng.randint(0, 1)
    steps = [
        Footstep(
            (first + number) % 2,
            waits[0] + number * interval,
            _SWINGS * interval,
            up=(-rise if down else rise) * min(number + 1, count),
            forward=tread * min(number + 1, count),
        )
        for number in range(count + 1)
    ]
    end = waits[0] + (count + 1) * interval
    quick = flight.pace == "fast"
    manner = Manner(rng.uniform(0.035, 0.05) if down else rng.uniform(0.05, 0.07), rng.uniform(14, 24), 0.028, 0.0)
    stoop = rng.uniform(-1, 3) if down else rng.uniform(6, 10) + 5 * quick
    swing, gaze = rng.uniform(12, 18) * (1.5 if quick else 1.0), rng.uniform(8, 14) if down else rng.uniform(0, 6)

    def change(body: StandingBody) -> None:
        time = np.arange(len(body.joints)) / FPS
        moving = eased((time - waits[0] + 0.2) / 0.5) * (1 - eased((time - end + 0.3) / 0.6))
        body.lean(stoop * moving, "left")
        body.turn(NECK, "left", gaze * moving)
        swing_arms_with(body, steps, swing)
        floor = body.joints[:, _TOES, 1].min()
        body.joints[:] = stepped(body.joints, steps, manner)
        body.joints[..., 1] += floor - body.joints[:, _TOES, 1].min()

    kinds = ("climb-stairs", "stairs-down" if down else "stairs-up")
    return Gesture(end + waits[1], kinds, change, times=count)
