"""A floor that is vacuumed: one hand pushes ahead and pulls back at the height of the hips, over a stride."""

from __future__ import annotations

import random

from marey.drawing.flights import StandingFeet, on_feet
from marey.drawing.gesture import Gesture
from marey.drawing.postures import HandPlace, Posture
from marey.drawing.sequels import Sequel
from marey.posing.standing import LEFT, RIGHT

STROKE_S = 1.5
"""Seconds of a push and the pull behind it, about."""
_BACK, _AHEAD = 0.14, 0.68
"""Metres forward of the foot behind of the hand, at the ends of its way."""
_WALKS, _STROKES = 0.3, 3
"""Metres by which the body goes on after so many strokes."""


def vacuuming(rng: random.Random, side: str = "", *, seconds: float | None = None) -> Gesture:
    """A body that vacuums.

    Args:
        rng: decides sizes and times.
        side: of the hand; empty = the right.
        seconds: to be filled; None = for six to eight.
    """
    pace, stride = rng.uniform(0.94, 1.06), rng.uniform(0.4, 0.46)
    number = max(round(((seconds or rng.uniform(6.0, 8.0)) - 1.7) / (STROKE_S * pace)), 1)
    outs = [rng.uniform(0.12, 0.3) for _ in range(number)]

    def sequel(feet: StandingFeet) -> Sequel:
        done, at = Sequel([0.25]), 0.0

        def rocked(share: float, out: float) -> Posture:
            far = at + _BACK + share * (_AHEAD - _BACK)
            behind = feet[RIGHT].tiptoe(26 * share, at) if share > 0.5 else feet[RIGHT].flat(at)
            return Posture(
                (0.0, 0.9 - 0.03 * share, at + 0.1 + 0.24 * share),
                (6, 0, 0),
                (8 + 9 * share, 0, 8 * share),
                (14, 0, 0),
                hands={
                    LEFT: HandPlace((0.14, -0.44, 0.1), "shoulder", (0.5, -0.6, -0.8)),
                    RIGHT: HandPlace((out, 0.93 - 0.06 * share, far), "floor", (0.7, -0.5, -0.8)),
                },
                feet={LEFT: feet[LEFT].flat(at + stride), RIGHT: behind},
            )

        done.then(0.6, rocked(0.1, outs[0]))
        for stroke, out in enumerate(outs):
            if stroke and stroke % _STROKES == 0:
                at += _WALKS
            done.then(0.55 * STROKE_S * pace, rocked(1.0, out))
            done.then(0.45 * STROKE_S * pace, rocked(0.0, out))
        ends = {LEFT: feet[LEFT].flat(at + 0.02), RIGHT: feet[RIGHT].flat(at)}
        done.then(0.6, Posture((0.0, 0.94, at), feet=ends))
        return done

    return on_feet(sequel, ["vacuuming"], 0.2, mirror=side == LEFT, times=number)
