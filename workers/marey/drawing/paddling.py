"""Strokes of a paddle by a body that sits low: of a kayak on either side in turn, of a canoe on one side."""

from __future__ import annotations

import random
from dataclasses import replace

from marey.drawing.gesture import SIDES, Gesture
from marey.drawing.postures import FootPlace, HandPlace, Point, Posture, mirrored
from marey.drawing.sequels import Sequel
from marey.posing.standing import LEFT, RIGHT

_OUT: Point = (0.8, -0.6, -0.2)
_HIGH: Point = (0.9, -0.4, 0.1)
STROKES_A_SIDE = 3
"""Strokes of a canoe before the paddle changes its side."""


def paddling(
    rng: random.Random,
    times: int | None = None,
    seconds: float | None = None,
    *,
    one_sided: bool = False,
    side: str = "",
) -> Gesture:
    """A body that sits with its legs ahead and paddles.

    Args:
        rng: decides sizes and times.
        times: how many strokes; None = as many as fill the time.
        seconds: to be filled; None = for six seconds.
        one_sided: a single blade, which stays on one side for some strokes; otherwise one at each end.
        side: where the strokes are, or begin; empty = either.
    """
    pace, seat = rng.uniform(0.95, 1.1), rng.uniform(0.21, 0.24)
    stroke = (1.5 if one_sided else 1.05) * pace
    times = times or max(2, round((seconds or 6.0) / stroke))
    first = side or rng.choice(SIDES)
    feet: dict[str, FootPlace] = dict.fromkeys(SIDES, FootPlace((0.13, 0.0, 0.62), (0.1, 0.75, 0.65)))
    knees: dict[str, Point] = dict.fromkeys(SIDES, (0.4, 1.0, 0.2))

    def at(lean: float, turned: float, low: Point, high: Point) -> Posture:
        """The trunk leant by degrees and turned to the left; wrists of the right hand, at the water, and the left."""
        hands = {RIGHT: HandPlace(low, "shoulder", _OUT), LEFT: HandPlace(high, "shoulder", _HIGH)}
        bend = (0.4 * lean, 0, 0.15 * turned), (0.6 * lean, 4, 0.85 * turned), (-0.5 * lean, 0, -0.7 * turned)
        return Posture((0.0, seat, 0.0), *bend, hands=hands, feet=feet, knees=knees)

    catch = at(20, 30, (0.1, -0.26, 0.44), (-0.02, 0.06, 0.26))
    middle = at(14, 0, (0.2, -0.4, 0.26), (-0.12, 0.04, 0.38))
    finish = at(6, -32, (0.26, -0.38, -0.04), (-0.2, 0.02, 0.44))
    leaves = at(6, -28, (0.28, -0.2, 0.0), (-0.14, -0.1, 0.4))
    over = at(12, 4, (0.24, -0.06, 0.3), (-0.04, 0.02, 0.34))

    def sided(posture: Posture, right: bool) -> Posture:
        return posture if right else mirrored(posture)

    right = first == RIGHT
    done = Sequel([rng.uniform(0.1, 0.25)], [sided(catch, right)])
    for number in range(times):
        last = number + 1 == times
        done.then(0.3 * pace, sided(middle, right))
        done.then(0.3 * pace, sided(finish, right))
        done.then(0.15 * pace, sided(leaves, right))
        if not one_sided:
            right = not right
            done.then(0.3 * pace, sided(catch, right), 0.1 if last else 0.0)
            continue
        done.then(0.4 * pace, sided(over, right))
        if (number + 1) % STROKES_A_SIDE == 0 and not last:
            right = not right
            done.then(0.45 * pace, sided(over, right))
        done.then(0.35 * pace, sided(catch, right), 0.05)
    return replace(done.gesture(rng, ["paddling"], times=times), seconds=done.times[-1] + 0.1)
