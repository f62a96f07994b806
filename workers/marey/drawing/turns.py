"""Turns on the spot with small steps: the inner foot opens, the outer one follows past it, and the last one closes.

Feet stand still between their steps; the trunk leads. A turn ends as far round as it is asked for.
"""

from __future__ import annotations

import random
from collections.abc import Iterator

import numpy as np

from marey.drawing.footsteps import Footstep, Manner, stepped
from marey.drawing.gesture import SIDES, Gesture
from marey.posing.limbs import FPS
from marey.posing.standing import LEFT, RIGHT, StandingBody, eased

_OPENS, _CLOSES = 50.0, 20.0
"""Degrees by which the inner foot opens, and by which the outer one is put past it."""
_MOST_SCALED = 1.3
"""How many times as far a foot turns in a step at most."""
_TURN_S = {"slow": (0.66, 0.76), "": (0.38, 0.42), "fast": (0.25, 0.28)}
"""Seconds from one step of a turn to the next, by its pace."""
_SPIN_S = {"slow": (0.27, 0.29), "": (0.21, 0.24), "fast": (0.16, 0.18)}
"""The same of a spin."""
_LONGEST_S = 8.5
"""Seconds of a turn of any size at most."""
_SWINGS = 0.92
"""Share of the time to the next step in which a foot is in the air."""
_SINKS = 0.015
"""Metres by which the hips are lower on the way."""


def turn_on_spot(
    rng: random.Random, degrees: float, *, pace: str = "", spins: bool = False, waits: tuple[float, float]
) -> Gesture:
    """A turn on the spot by small steps.

    Args:
        rng: decides what is not given.
        degrees: of the turn, positive to the left.
        pace: slow, fast or empty.
        spins: in one go, on quick steps.
        waits: seconds that the body stands before it and after it.
    """
    feet = list(_feet_turned(abs(degrees)))
    interval = min(rng.uniform(*(_SPIN_S if spins else _TURN_S)[pace]), _LONGEST_S / len(feet))
    inner = 0 if degrees > 0 else 1
    steps = [
        Footstep(
            (inner + number) % 2,
            waits[0] + number * interval,
            _SWINGS * interval,
            degrees=float(np.copysign(turned, degrees)),
        )
        for number, turned in enumerate(feet)
    ]
    end = waits[0] + len(feet) * interval
    look = min(rng.uniform(0.14, 0.2), 0.4 * interval)
    manner = Manner(rng.uniform(0.035, 0.055), rng.uniform(14, 26), rng.uniform(0.02, 0.032), look)
    arms = rng.uniform(2.0, 5.0) + 5.0 * spins

    def change(body: StandingBody) -> None:
        time = np.arange(len(body.joints)) / FPS
        moving = eased((time - waits[0] + 0.15) / 0.4) * (1 - eased((time - end + 0.2) / 0.45))
        for side in SIDES:
            body.lift_arm(side, arms * moving)
        body.shift(-_SINKS * moving)
        body.joints[:] = stepped(body.joints, steps, manner)

    kinds = ("spin", "spin-steps") if spins else ("turn-around",)
    return Gesture(end + waits[1], kinds, change, LEFT if degrees > 0 else RIGHT)


def _feet_turned(degrees: float) -> Iterator[float]:
    """Yield how far round the inner foot, the outer one, and so on is after each step; the last two end alike."""
    ways, turned = list[float](), 0.0
    while not ways or ways[-1] * _MOST_SCALED < degrees:
        turned += _OPENS if len(ways) % 2 == 0 else _CLOSES
        ways.append(turned)
    yield from (each * degrees / ways[-1] for each in ways)
    yield degrees
