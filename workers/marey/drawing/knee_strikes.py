"""Knee strikes: both hands pull an opponent down onto a knee that is driven up."""

from __future__ import annotations

import random

from marey.drawing.gesture import SIDES, Gesture
from marey.drawing.postures import STAND, FootPlace, HandPlace, Posture
from marey.drawing.sequels import Sequel, both, near
from marey.posing.standing import LEFT, RIGHT

_GUARD = HandPlace((0.06, -0.04, 0.26), "trunk", (0.5, -1.0, -0.1))
_HOLDS = HandPlace((-0.06, 0.06, 0.44), "shoulder", (0.7, -0.7, -0.1))
_PULLED = HandPlace((0.04, -0.3, 0.24), "shoulder", (0.8, -0.2, -0.6))
"""Hands before the face, at the neck of an opponent, and pulled down beside the knee."""


def knee_strike(rng: random.Random, side: str = "", times: int | None = None) -> Gesture:
    """A body that stands and drives a knee into an opponent before it.

    Args:
        rng: decides everything that is not given.
        side: of the knee.
        times: how many strikes; None = one.
    """
    times, side, pace = times or 1, side or rng.choice(SIDES), rng.uniform(0.92, 1.15)
    behind = FootPlace((0.12, 0.1, -rng.uniform(0.32, 0.42)), (0.2, -0.62, 0.76))
    stance = Posture((0.0, 0.89, -0.1), (6, 0, 0), (8, 0, 0), (-8, 0, 0), hands=both(_GUARD), feet={LEFT: behind})
    holds = Posture((0.0, 0.88, -0.06), (8, 0, 0), (6, 0, 0), (-8, 0, 0), hands=both(_HOLDS), feet={LEFT: behind})
    up = rng.uniform(0.62, 0.72)
    struck = Posture(
        (0.03, 0.945, 0.1),
        (-rng.uniform(12, 18), 0, -6),
        (rng.uniform(20, 28), 0, 0),
        over=RIGHT,
        hands=both(_PULLED),
        feet={LEFT: FootPlace(near(rng, (0.03, up, 0.2)), (0, -0.9, 0.15))},
        knees={LEFT: (0.0, 0.9, 1.0)},
    )
    done = Sequel([rng.uniform(0.2, 0.5)])
    done.then(0.4 * pace, stance, 0.1)
    for _ in range(times):
        done.then(0.26 * pace, holds, 0.05)
        done.then(0.21 * pace, struck, 0.07)
        done.then(0.34 * pace, stance, 0.06)
    done.then(0.55 * pace, STAND)
    told = done if side == LEFT else done.mirrored()
    return told.gesture(rng, ["knee-strike"], side, times)
