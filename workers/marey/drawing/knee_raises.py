"""Knees that are lifted to the hips or to the chest, on one leg, and set down again."""

from __future__ import annotations

import random
from dataclasses import replace

from marey.drawing.gesture import SIDES, Gesture
from marey.drawing.postures import STAND, FootPlace, HandPlace, Posture
from marey.drawing.sequels import Sequel, near
from marey.posing.standing import LEFT, RIGHT

_HEIGHTS: dict[str, tuple[FootPlace, float]] = {
    "hip": (FootPlace((0.09, 0.46, 0.22), (0.0, -0.55, 0.83)), 2.0),
    "chest": (FootPlace((0.08, 0.66, 0.2), (0.0, -0.7, 0.7)), 7.0),
}
"""Where the lifted foot is, and degrees by which the trunk comes to the knee, by the height of the knee."""
_ON_SHIN = {
    LEFT: HandPlace((0.02, -0.1, 0.13), "knee", (0.9, -0.4, -0.3)),
    RIGHT: HandPlace((-0.2, -0.38, 0.36), "shoulder", (0.8, -0.6, -0.3)),
}
"""Hands that draw the knee to the chest."""
_HELD_S = 0.35, 0.7


def knee_raise(
    rng: random.Random,
    side: str = "",
    times: int | None = None,
    *,
    height: str = "hip",
    pulled: bool = False,
    hold: float | None = None,
) -> Gesture:
    """A body that stands and lifts a knee.

    Args:
        rng: decides everything that is not given.
        side: of the knee.
        times: how often; None = once.
        height: hip or chest, to which the knee goes.
        pulled: the hands draw it there.
        hold: seconds for which it is up; None = a moment.
    """
    times, side, pace = times or 1, side or rng.choice(SIDES), rng.uniform(0.9, 1.15)
    foot, stoop = _HEIGHTS[height]
    over = Posture((0.03, 0.93, 0.0), over=RIGHT)
    up = replace(over, tilt=(-2.0, 0, 0), spine=(stoop, 0, 0), hands=_ON_SHIN if pulled else {})
    up = replace(up, feet={LEFT: replace(foot, at=near(rng, foot.at, 0.015))}, knees={LEFT: (0.05, 0.6, 1.0)})
    done = Sequel([rng.uniform(0.2, 0.6)])
    done.then(0.35 * pace, over)
    for number in range(times):
        done.then(0.55 * pace, up, hold if hold is not None else rng.uniform(*_HELD_S))
        done.then(0.55 * pace, over, 0.1 if number < times - 1 else 0.0)
    done.then(0.4 * pace, STAND)
    return (done if side == LEFT else done.mirrored()).gesture(rng, ["knee-raise"], side, times)
