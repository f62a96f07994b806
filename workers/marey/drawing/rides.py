"""Rides: a horse at a walk, a trot or a gallop, and a bicycle. The mount is mimed: feet stand in stirrups that touch
the floor, and pedals pass just over it."""

from __future__ import annotations

import math
import random

from marey.drawing.gesture import SIDES, Gesture
from marey.drawing.postures import FootPlace, HandPlace, Point, Posture
from marey.drawing.sequels import Sequel, both

_SADDLE_M, _STIRRUPS_M = 0.74, 0.31
"""Metres of the hips over the floor, and of each ankle from the middle."""
_PACES: dict[str, tuple[float, float, float, float, float]] = {
    "walk": (1.05, 0.012, 0.025, 2.0, 2.0),
    "trot": (0.66, 0.075, 0.05, 7.0, 3.0),
    "gallop": (0.52, 0.055, 0.075, 24.0, 7.0),
}
"""Of a pace: seconds of a stride, metres by which the hips rise and go forward in it, degrees of the trunk's lean, and
by how much that changes."""
_SADDLE_OF_BICYCLE_M, _CRANK_M, _AXLE = 0.88, 0.165, (0.1, 0.235, 0.1)
_TURN_S, _PARTS = 0.95, 8
"""Seconds of a turn of the pedals, and in how many postures it is drawn."""


def horse_ride(rng: random.Random, pace: str = "walk", seconds: float | None = None) -> Gesture:
    """A body that sits astride with bent knees, reins in both hands, and goes along with each stride of the horse.

    Args:
        rng: decides sizes and times.
        pace: `walk`, `trot` or `gallop`.
        seconds: to be filled; None = about five.

    Raises:
        KeyError: no such pace.
    """
    stride, rise, ahead, lean, nods = _PACES[pace]
    stride *= rng.uniform(0.95, 1.08)
    number = max(2, round((seconds or rng.uniform(4.5, 5.5)) / stride))
    feet: dict[str, FootPlace] = dict.fromkeys(SIDES, FootPlace((_STIRRUPS_M, 0.07, 0.06)))
    knees: dict[str, Point] = dict.fromkeys(SIDES, (0.65, 0.1, 1.0))

    def at(up: float, forward: float, trunk: float, reins: float) -> Posture:
        """Hips moved by shares of their way, the trunk leant by degrees, the hands moved forward by metres."""
        hands = both(HandPlace((-0.08, -0.3, 0.3 + reins), "shoulder", (0.7, -0.9, -0.4)))
        bend = (0.4 * trunk, 0, 0), (0.6 * trunk, 0, 0), (-0.8 * trunk, 0, 0)
        return Posture((0.0, _SADDLE_M + rise * up, ahead * forward), *bend, hands=hands, feet=feet, knees=knees)

    sits, rises = at(0.0, -0.5, lean - nods, 0.0), at(1.0, 0.5, lean + nods, 0.03 if pace == "gallop" else 0.01)
    done = Sequel([rng.uniform(0.1, 0.2)], [sits])
    for _ in range(number):
        done.then(0.5 * stride, rises)
        done.then(0.5 * stride, sits)
    return done.gesture(rng, ["riding"])


def bicycle_ride(rng: random.Random, *, fast: bool = False, seconds: float | None = None) -> Gesture:
    """A body on a saddle whose feet go round with the pedals and whose hands hold the bar.

    Args:
        rng: decides sizes and times.
        fast: the pedals turn faster, and the trunk leans further.
        seconds: to be filled; None = about five.
    """
    turn, lean = _TURN_S * rng.uniform(0.92, 1.08) * (0.62 if fast else 1.0), rng.uniform(20, 26) + 14 * fast
    turns = max(2, round((seconds or rng.uniform(4.5, 5.5)) / turn))
    begins = rng.choice((0.0, math.pi))
    hands = both(HandPlace((0.0, -0.2, 0.46), "shoulder", (0.9, -0.7, -0.2)))
    knees: dict[str, Point] = dict.fromkeys(SIDES, (0.12, 0.1, 1.0))
    out, up, ahead = _AXLE

    def at(angle: float) -> Posture:
        """The pedals turned by an angle in radians: at zero the left foot is ahead, and then goes down."""
        turned = {"left": angle, "right": angle + math.pi}
        feet = {
            side: FootPlace(
                (out, up - _CRANK_M * math.sin(each), ahead + _CRANK_M * math.cos(each)),
                (0.05, -0.18 - 0.12 * math.cos(each), 1.0),
            )
            for side, each in turned.items()
        }
        rolls = 2.0 * math.sin(angle)
        return Posture(
            (0.0, _SADDLE_OF_BICYCLE_M, 0.0),
            (0.4 * lean, -rolls, 0),
            (0.6 * lean, rolls, 0),
            (-0.7 * lean, 0, 0),
            hands=hands,
            feet=feet,
            knees=knees,
        )

    done = Sequel([rng.uniform(0.1, 0.2)], [at(begins)])
    for each in range(1, turns * _PARTS + 1):
        done.then(turn / _PARTS, at(begins + 2.0 * math.pi * each / _PARTS))
    return done.gesture(rng, ["riding"])
