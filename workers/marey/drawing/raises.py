"""Arms that are raised to a height and in a direction that are given."""

from __future__ import annotations

import random
from dataclasses import dataclass

import numpy as np

from marey.drawing.gesture import BOTH, Gesture
from marey.drawing.parts import arms_of, respond
from marey.posing.standing import StandingBody, direction, envelope

FRONT, SIDE = "front", "side"
_AHEAD, _ASIDE = (-3.0, 8.0), (84.0, 96.0)
"""Azimuth of an arm that is raised to the front and to the side, degrees."""
_HEIGHTS = {
    "waist": {FRONT: ((-80, -72), (-4, 4)), SIDE: ((-54, -48), (-46, -38))},
    "chest": {FRONT: ((-30, -24), (-12, -6)), SIDE: ((-26, -20), (-18, -12))},
    "shoulder": {FRONT: ((3, 7), (8, 12)), SIDE: ((3, 7), (7, 11))},
    "head": {FRONT: ((16, 22), (36, 44)), SIDE: ((20, 26), (32, 38))},
    "overhead": {FRONT: ((68, 80), (78, 88)), SIDE: ((68, 80), (78, 88))},
}
"""Elevations of upper arm and forearm, degrees, by height and direction."""
_RISE, _HOLD, _PAUSE = (0.6, 0.95), (0.8, 1.5), (0.25, 0.45)
"""Seconds in which an arm goes up, stays, and rests before it goes up again."""
_KEPT = (2.0, 3.0)
"""Seconds for which an arm stays at the end that does not come down."""


@dataclass(frozen=True)
class Raise:
    """How arms are raised.

    Attributes:
        side: left, right or both.
        height: of the hand, waist, chest, shoulder, head or overhead.
        way: front or side.
        times: how often.
        keeps: at the end the arm stays up.
        hold: seconds for which it stays up; None = a moment.
    """

    side: str
    height: str
    way: str
    times: int = 1
    keeps: bool = False
    hold: float | None = None


def raise_to(rng: random.Random, form: Raise) -> Gesture:
    """Arms that go up to a height, stay there for a moment, and come down again, as often as asked for.

    Args:
        rng: decides the pace and the last degrees.
        form: what is asked for.
    """
    upper, fore = _HEIGHTS[form.height][form.way]
    azimuth = rng.uniform(*(_AHEAD if form.way == FRONT else _ASIDE))
    ends = direction(azimuth, rng.uniform(*upper)), direction(azimuth, rng.uniform(*fore))
    rise = rng.uniform(*_RISE) * (1.3 if form.height == "overhead" else 1.0)
    hold = form.hold or rng.uniform(*(_KEPT if form.keeps else _HOLD))
    fall, pause, start = rise * rng.uniform(1.0, 1.3), rng.uniform(*_PAUSE), rng.uniform(0.3, 0.6)
    round_s = rise + hold + fall + pause
    total = start + form.times * round_s - (fall + pause if form.keeps else 0.0)
    twist, sway = rng.uniform(-1, 2), rng.uniform(0, 2)

    def change(body: StandingBody) -> None:
        way = np.zeros(len(body.joints))
        for number in range(form.times):
            last = form.keeps and number == form.times - 1
            stays = len(way) if last else hold  # frames are more than seconds: longer than the motion
            way += envelope(len(way), start + number * round_s, rise, stays, fall)
        respond(body, way, form.side, twist, sway)
        for one in arms_of(form.side):
            body.move_arm(one, way, *ends, 0.04, straight=form.height != "overhead")

    side = "" if form.side == BOTH else form.side
    return Gesture(total + (0.0 if form.keeps else rng.uniform(0.3, 0.7)), ("raise-to",), change, side, form.times)
