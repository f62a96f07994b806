"""Burpees: down onto the hands, the feet back and ahead again, and a jump with raised hands."""

from __future__ import annotations

import random
from dataclasses import replace

from marey.drawing.gesture import SIDES, Gesture
from marey.drawing.postures import STAND, FootPlace, HandPlace, Point, Posture
from marey.drawing.sequels import Sequel, both
from marey.posing.limbs import GRAVITY

_HANDS_AHEAD, _FEET_BEHIND = 0.4, -0.895
"""Metres forward of where the feet stood of hands and ankles of a body that is held straight on them."""
_APART: dict[str, Point] = dict.fromkeys(SIDES, (0.35, 0.2, 1.0))
_DOWN: dict[str, Point] = dict.fromkeys(SIDES, (0.0, -1.0, 0.1))
_RAISED = HandPlace((0.06, 0.5, 0.06), "shoulder", (0.7, 0.2, -0.5))
_OFF = FootPlace((0.1, 0.12, 0.0), (0.1, -0.75, 0.65))


def burpees(rng: random.Random, times: int | None = None) -> Gesture:
    """A body that stands and does burpees.

    Args:
        rng: decides everything that is not given.
        times: how many; None = two or three.
    """
    times = times or rng.choice((2, 2, 3))
    pace, lowers = rng.uniform(0.9, 1.1), rng.random() < 0.6
    done = Sequel([rng.uniform(0.2, 0.5)])
    for _ in range(times):
        _down_and_up(rng, done, pace, lowers)
        _jump(done, pace, rng.uniform(0.12, 0.18))
    done.then(0.4, STAND)
    return done.gesture(rng, ["burpees"], times=times)


def _down_and_up(rng: random.Random, done: Sequel, pace: float, lowers: bool) -> None:
    """Crouch, hands on the floor, the feet back into a straight line, to the chest and up, and the feet ahead again."""
    hands = both(HandPlace((0.26, 0.05, _HANDS_AHEAD), "floor", (0.6, 0.5, -0.7)))
    crouch = Posture((0.0, 0.5, 0.0), (50, 0, 0), (46, 0, 0), (-20, 0, 0), 0.8, hands, knees=_APART)
    feet: dict[str, FootPlace] = dict.fromkeys(SIDES, FootPlace((0.1, 0.155, _FEET_BEHIND), (0.0, -0.95, 0.3)))
    plank = Posture((0.0, 0.38, _FEET_BEHIND + 0.846), (75, 0, 0), (0, 0, 0), (-20, 0, 0), 0.0, hands, feet, _DOWN)
    low = replace(plank, pelvis=(0.0, 0.235, _FEET_BEHIND + 0.87), tilt=(85, 0, 0), neck=(-24, 0, 0))
    tucked = FootPlace((0.1, 0.26, 0.5 * _FEET_BEHIND), (0.0, -0.85, 0.5))
    hop = replace(
        crouch, pelvis=(0.0, 0.58, 0.02), tilt=(66, 0, 0), spine=(34, 0, 0), feet=dict.fromkeys(SIDES, tucked)
    )
    done.then(0.5 * pace, crouch, 0.06)
    done.then(0.17 * pace, hop)
    done.then(0.19 * pace, plank, rng.uniform(0.14, 0.24))
    if lowers:
        done.then(0.4 * pace, low)
        done.then(0.4 * pace, plank, 0.06)
    done.then(0.19 * pace, hop)
    done.then(0.17 * pace, crouch, 0.04)


def _jump(done: Sequel, pace: float, high: float) -> None:
    """From a crouch off the floor by `high` metres, and back onto both feet."""
    half = (2 * high / GRAVITY) ** 0.5
    off = Posture((0.0, 0.97, 0.02), (0, 0, 0), (-4, 0, 0), hands=both(_RAISED), feet=dict.fromkeys(SIDES, _OFF))
    lifted = replace(_OFF, at=(0.1, _OFF.at[1] + high, 0.0))
    air = replace(off, pelvis=(0.0, 0.97 + high, 0.02), feet=dict.fromkeys(SIDES, lifted))
    bent = Posture((0.0, 0.82, -0.03), (14, 0, 0), (10, 0, 0), (-8, 0, 0), knees=_APART)
    loaded = Posture((0.0, 0.66, -0.06), (32, 0, 0), (18, 0, 0), (-12, 0, 0), 0.5, knees=_APART)
    done.then(0.2 * pace, loaded)
    done.then(0.22 * pace, off)
    done.then(half, air)
    done.then(half, replace(off, hands=both(HandPlace((0.3, 0.2, 0.1), "shoulder", (0.6, -0.2, -0.6)))))
    done.then(0.16 * pace, bent)
    done.then(0.3 * pace, STAND, 0.05)
