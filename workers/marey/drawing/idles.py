"""A body that stands and waits: it breathes, shifts its weight from leg to leg and looks about a little."""

from __future__ import annotations

import random

import numpy as np

from marey.drawing.gesture import Gesture
from marey.motion.filters import smooth
from marey.posing.limbs import FPS
from marey.posing.standing import NECK, StandingBody, way_through

_SECONDS = (4.0, 6.0)
_STANDS_S, _SHIFTS_S = (1.2, 2.8), (0.7, 1.2)
"""Seconds on one leg, and on the way to the other."""
_ASIDE_M, _AHEAD_M = (0.012, 0.045), (-0.01, 0.012)
"""Metres by which the hips go to the side of the leg that carries, and ahead."""
_ROLL = 70.0
"""Degrees by which the trunk leans back over the middle, by metre of the hips aside."""
_HEAD = (-9.0, 9.0)
"""Degrees by which the head turns."""
_SMOOTH_S = 0.25


def idle(rng: random.Random) -> Gesture:
    """Stand on both feet, the weight now on one and now on the other."""
    seconds, seed = rng.uniform(*_SECONDS), rng.random()

    def change(body: StandingBody) -> None:
        chance = random.Random(seed)  # noqa: S311
        time = np.arange(len(body.joints)) / FPS
        times, points = [0.0], [(0.0, 0.0, 0.0)]
        side = chance.choice((-1.0, 1.0))
        while times[-1] < time[-1]:
            times += [times[-1] + chance.uniform(*_STANDS_S)]
            points += [points[-1]]
            times += [times[-1] + chance.uniform(*_SHIFTS_S)]
            points += [(side * chance.uniform(*_ASIDE_M), chance.uniform(*_AHEAD_M), chance.uniform(*_HEAD))]
            side = -side
        aside, ahead, look = smooth(way_through(time, times, points), _SMOOTH_S * FPS).T
        body.shift(-0.2 * np.abs(aside), ahead, aside)
        body.lean(_ROLL * aside, "forward")
        body.turn(NECK, "up", look)

    return Gesture(seconds, ("idle",), change, fills=True)
