"""A baseball that is pitched: the leg goes up, a long stride, and the arm over the front leg."""

from __future__ import annotations

import random
from collections.abc import Callable

from marey.drawing.flights import StandingFeet, on_feet
from marey.drawing.gesture import Gesture
from marey.drawing.postures import ELBOW_BACK, ELBOW_DOWN, ELBOW_OUT, FootPlace, HandPlace, Posture
from marey.drawing.sequels import Sequel
from marey.posing.standing import LEFT, RIGHT

_SIDEWAYS = -78.0
"""Degrees by which a body that throws with the right hand has turned to its right when the leg is up."""
_TUCKED = HandPlace((0.02, -0.26, 0.16), "trunk", ELBOW_BACK)
_GLOVE = HandPlace((-0.16, -0.14, 0.26), "trunk", ELBOW_DOWN)
_BALL = HandPlace((-0.14, -0.12, 0.24), "trunk", ELBOW_DOWN)


def pitch(rng: random.Random, side: str = "") -> Gesture:
    """A pitch with a windup: the hands meet, the front knee goes up, the foot strides, and the arm whips over.

    Args:
        rng: decides sizes and times.
        side: of the hand that throws; empty = right.
    """
    pace, stride, starts = rng.uniform(0.95, 1.1), rng.uniform(0.72, 0.84), rng.uniform(0.2, 0.4)
    sequel = _pitched(stride, pace, starts, rng.uniform(0.86, 0.98))
    return on_feet(sequel, ["throw", "pitch"], rng.uniform(0.3, 0.6), side=side or RIGHT, mirror=side == LEFT)


def _pitched(stride: float, pace: float, starts: float, knee: float) -> Callable[[StandingFeet], Sequel]:
    """Return the postures of a pitch with the right hand over the feet of an idle; `knee`: metres over the floor."""

    def sequel(feet: StandingFeet) -> Sequel:
        pivot = FootPlace((0.07, 0.07, 0.0), (1.0, -0.45, 0.2))  # across the way of the ball
        at = Posture((0.0, 0.93, 0.0), (4, 0, -10), (4, 0, -6), hands={RIGHT: _BALL, LEFT: _GLOVE})
        rocks = Posture(
            (0.0, 0.92, -0.06),
            (2, 0, -24),
            (0, 0, -14),
            (0, 0, 30),
            hands={RIGHT: _BALL, LEFT: _GLOVE},
            feet={LEFT: feet[LEFT].flat(-0.16), RIGHT: feet[RIGHT].flat()},
        )
        raised = Posture(
            (-0.07, 0.92, -0.01),
            (-4, 0, _SIDEWAYS),
            (4, 0, -16),
            (0, 0, 74),
            hands={RIGHT: _BALL, LEFT: _GLOVE},
            feet={LEFT: FootPlace((-0.28, knee - 0.38, 0.14), (-0.6, -0.7, 0.3)), RIGHT: pivot},
            knees={LEFT: (-0.7, 0.5, 0.5), RIGHT: (0.9, 0.0, 0.3)},
        )
        parted = {
            RIGHT: HandPlace((0.42, -0.24, -0.14), "trunk", ELBOW_OUT),
            LEFT: HandPlace((0.44, -0.06, 0.06), "trunk", ELBOW_OUT),
        }
        strides = Posture(
            (-0.04, 0.83, 0.3 * stride),
            (0, 8, _SIDEWAYS),
            (0, 4, -12),
            (0, 0, 72),
            hands=parted,
            feet={LEFT: FootPlace((-0.02, 0.16, 0.62 * stride), (-0.2, -0.4, 0.9)), RIGHT: pivot},
            knees={RIGHT: (0.9, 0.0, 0.4)},
        )
        planted = {LEFT: FootPlace((0.02, 0.07, stride), (0.1, -0.45, 0.9)), RIGHT: pivot}
        cocked = Posture(
            (0.0, 0.77, 0.56 * stride),
            (0, 2, -40),
            (-8, 0, -30),
            (-4, 0, 62),
            hands={
                RIGHT: HandPlace((0.26, 0.24, -0.18), "trunk", (1.0, 0.0, -0.1)),
                LEFT: HandPlace((0.1, -0.04, 0.42), "trunk", ELBOW_OUT),
            },
            feet=planted,
        )
        toes = {**planted, RIGHT: FootPlace((0.07, 0.16, 0.06), (0.3, -0.9, 0.5))}
        let_go = Posture(
            (0.02, 0.8, 0.78 * stride),
            (22, 0, 8),
            (18, -10, 10),
            (-26, 0, -6),
            hands={RIGHT: HandPlace((0.08, 0.36, 0.36), "shoulder", ELBOW_OUT), LEFT: _TUCKED},
            feet=toes,
        )
        through = Posture(
            (0.02, 0.78, 0.92 * stride),
            (34, 0, 24),
            (30, -4, 22),
            (-46, 0, -24),
            hands={RIGHT: HandPlace((-0.16, -0.3, 0.38), "shoulder", ELBOW_OUT), LEFT: _TUCKED},
            feet={LEFT: planted[LEFT], RIGHT: FootPlace((0.1, 0.42, 0.24), (0.1, -0.9, 0.1))},
        )
        follows = Posture(
            (0.02, 0.84, stride + 0.02),
            (20, 0, 14),
            (18, 0, 12),
            (-28, 0, -12),
            hands={RIGHT: HandPlace((-0.14, -0.4, 0.24), "shoulder", ELBOW_OUT), LEFT: _TUCKED},
            feet={LEFT: planted[LEFT], RIGHT: feet[RIGHT].flat(stride + 0.12)},
        )
        done = Sequel([starts])
        done.then(0.55 * pace, at, 0.3)
        done.then(0.4 * pace, rocks)
        done.then(0.62 * pace, raised, 0.14)
        done.then(0.4 * pace, strides)
        done.then(0.26, cocked)
        done.then(0.24, let_go)
        done.then(0.26, through)
        done.then(0.4, follows, 0.2)
        end = stride + 0.08
        done.then(0.6, Posture((0.0, 0.94, end), feet={one: foot.flat(end) for one, foot in feet.items()}))
        return done

    return sequel
