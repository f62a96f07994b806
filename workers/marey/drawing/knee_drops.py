"""Knees that give way: a body that stands and drops to both knees at once, and stays there, slumped."""

from __future__ import annotations

import random
from dataclasses import replace

from marey.drawing.flights import StandingFeet, on_feet
from marey.drawing.gesture import SIDES, Gesture
from marey.drawing.postures import HandPlace, Point, Posture
from marey.drawing.sequels import Sequel, both
from marey.posing.standing import LEFT

_AHEAD = 0.41
"""Metres by which the hips of who kneels upright are ahead of the ankles."""
_KNEES: dict[str, Point] = dict.fromkeys(SIDES, (0.06, -0.2, 1.0))
_LOOSE = both(HandPlace((0.1, -0.47, 0.06), "shoulder", (0.4, -0.6, -0.9)))
_FLUNG = both(HandPlace((0.26, -0.36, -0.04), "shoulder", (0.5, -0.6, -0.9)))


def drop_to_knees(rng: random.Random, *, slow: bool = False, stays: float = 1.6, starts: float = 0.3) -> Gesture:
    """A body whose knees give way.

    Args:
        rng: decides sizes and times.
        slow: it sinks.
        stays: seconds on the knees.
        starts: seconds of standing before.
    """
    falls = rng.uniform(1.0, 1.2) if slow else rng.uniform(0.52, 0.64)
    slump, bowed, rocks = rng.uniform(12, 18), rng.uniform(12, 20), rng.uniform(1.5, 3.0)

    def sequel(feet: StandingFeet) -> Sequel:
        down = {side: foot.tiptoe(68) for side, foot in feet.items()}
        ankle = down[LEFT].at[2]
        half = {side: foot.tiptoe(38) for side, foot in feet.items()}
        gives = Posture((0.0, 0.76, 0.1), (2, 0, 0), (8, 0, 0), (10, 0, 0), hands=_FLUNG, feet=half, knees=_KNEES)
        lands = Posture(
            (0.0, 0.505, ankle + _AHEAD - 0.02), (-4, 0, 0), (14, 0, 0), (14, 0, 0), 0.8, _FLUNG, down, _KNEES
        )
        rebound = replace(lands, pelvis=(0.0, 0.5, ankle + 0.37), tilt=(4, 0, 0), spine=(slump, 0, 0), hands=_LOOSE)
        sunk = replace(rebound, pelvis=(0.0, 0.48, ankle + 0.33), neck=(bowed, 0, 0))
        done = Sequel([starts])
        done.then(0.55 * falls, gives)
        done.then(0.45 * falls, lands)
        done.then(0.25, rebound)
        done.then(0.45, sunk)
        end = done.times[-1] + max(stays - 0.7, 0.1)
        while done.times[-1] < end:
            side = rocks if len(done.times) % 2 else -rocks
            swayed = replace(sunk, spine=(slump + 0.8 * side, 0.4 * side, 0), neck=(bowed - side, 0, 0))
            done.then(min(0.9, max(end - done.times[-1], 0.3)), swayed)
        return done

    return on_feet(sequel, ["kneel", "kneel-both", "kneel-down", "knee-drop"], 0.1)
