"""Doors that are pulled or pushed open with one hand, on a step."""

from __future__ import annotations

import random

from marey.drawing.flights import StandingFeet, on_feet
from marey.drawing.gesture import Gesture
from marey.drawing.postures import HandPlace, Point, Posture
from marey.drawing.sequels import Sequel
from marey.posing.standing import LEFT, RIGHT

_HANDLE = 1.0
"""Metres of a handle over the floor."""
_PULLS: Point = (0.9, -0.7, -0.5)
_PUSHES: Point = (0.7, -0.9, -0.2)


def pulled_door(rng: random.Random, side: str = "", *, heavy: bool = False, brief: bool = False) -> Gesture:
    """A hand goes to a handle, and a step back brings the door along, out of the way.

    Args:
        rng: decides sizes and times.
        side: of the hand; empty = the right.
        heavy: it takes longer, the trunk leans back.
        brief: other things are done before or after it.
    """
    pace, starts = rng.uniform(0.95, 1.08) * (1.35 if heavy else 1.0), 0.08 if brief else rng.uniform(0.25, 0.45)
    far, leans = rng.uniform(0.4, 0.48), -8.0 if heavy else -2.0

    def sequel(feet: StandingFeet) -> Sequel:
        rests = {one: foot.flat() for one, foot in feet.items()}
        stepped = {LEFT: feet[LEFT].flat(), RIGHT: feet[RIGHT].flat(-far)}
        closed = {LEFT: feet[LEFT].flat(-far + 0.04), RIGHT: feet[RIGHT].flat(-far)}

        def hand(out: float, forward: float) -> dict[str, HandPlace]:
            return {RIGHT: HandPlace((out, _HANDLE, forward), "floor", _PULLS)}

        reach = Posture((0.0, 0.93, 0.05), (5, 0, 0), (7, 0, 6), (10, 0, 0), hands=hand(0.1, 0.5), feet=rests)
        turns = Posture((0.0, 0.93, 0.04), (5, 0, 0), (6, 0, 6), (10, 0, 0), hands=hand(0.08, 0.49), feet=rests)
        pulls = Posture(
            (0.0, 0.89, -0.5 * far), (2, 0, 0), (leans, 0, -12), (6, 0, 6), hands=hand(0.24, 0.08), feet=stepped
        )
        clear = Posture(
            (0.0, 0.93, -far), (0, 0, 0), (0.5 * leans, 0, -16), (2, 0, 10), hands=hand(0.5, -0.22), feet=closed
        )
        done = Sequel([starts])
        done.then(0.55, reach, 0.1)
        done.then(0.22, turns)
        done.then(0.62 * pace, pulls)
        done.then(0.5 * pace, clear, 0.08)
        done.then(0.5, Posture((0.0, 0.94, -far + 0.02), feet=closed))
        return done

    return on_feet(sequel, ["door-pull"], 0.12 if brief else rng.uniform(0.4, 0.7), mirror=side == LEFT)


def pushed_door(
    rng: random.Random, side: str = "", *, both: bool = False, heavy: bool = False, brief: bool = False
) -> Gesture:
    """A hand, or both, go flat against a door and push it ahead on two steps.

    Args:
        rng: decides sizes and times.
        side: of the hand; empty = the right.
        both: both hands push.
        heavy: both hands push for longer, and the trunk leans in.
        brief: other things are done before or after it.
    """
    pace, starts = rng.uniform(0.95, 1.08) * (1.4 if heavy else 1.0), 0.08 if brief else rng.uniform(0.25, 0.45)
    stride, leans = rng.uniform(0.46, 0.54), 16.0 if heavy or both else 5.0
    sides = (LEFT, RIGHT) if heavy or both else (RIGHT,)

    def sequel(feet: StandingFeet) -> Sequel:
        rests = {one: foot.flat() for one, foot in feet.items()}
        ahead = {LEFT: feet[LEFT].flat(stride), RIGHT: feet[RIGHT].tiptoe(24)}
        through = {LEFT: feet[LEFT].flat(stride), RIGHT: feet[RIGHT].flat(1.55 * stride)}
        closed = {LEFT: feet[LEFT].flat(1.55 * stride + 0.02), RIGHT: feet[RIGHT].flat(1.55 * stride)}

        def hand(out: float, forward: float) -> dict[str, HandPlace]:
            return {one: HandPlace((out, _HANDLE + 0.14, forward), "floor", _PUSHES) for one in sides}

        reach = Posture((0.0, 0.93, 0.04), (4, 0, 0), (leans, 0, 6), (4, 0, 0), hands=hand(0.1, 0.46), feet=rests)
        pushes = Posture(
            (0.0, 0.9, 0.62 * stride), (6, 0, 0), (leans, 0, 10), (2, 0, 0), hands=hand(0.12, 0.46 + stride), feet=ahead
        )
        opens = Posture(
            (0.0, 0.91, 1.2 * stride),
            (3, 0, 0),
            (0.6 * leans, 0, 4),
            (2, 0, 0),
            hands=hand(0.42, 0.36 + 1.3 * stride),
            feet=through,
        )
        done = Sequel([starts])
        done.then(0.5, reach, 0.06)
        done.then(0.55 * pace, pushes)
        done.then(0.55 * pace, opens)
        done.then(0.5, Posture((0.0, 0.94, 1.55 * stride), feet=closed))
        return done

    return on_feet(sequel, ["door-push"], 0.12 if brief else rng.uniform(0.4, 0.7), mirror=side == LEFT)
