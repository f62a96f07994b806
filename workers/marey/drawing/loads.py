"""Loads that two hands lift from the floor and hold, and put down again on the floor, a table or a shelf."""

from __future__ import annotations

import random
from dataclasses import replace

from marey.drawing.flights import StandingFeet, on_feet
from marey.drawing.gesture import SIDES, Gesture
from marey.drawing.postures import HandPlace, Point, Posture
from marey.drawing.sequels import Sequel, both

_ELBOW: Point = (0.5, -0.7, -0.8)
_HELD = both(HandPlace((-0.02, -0.27, 0.31), "shoulder", _ELBOW))
"""Wrists of who has a load before the belly, as far apart as in all postures of these movements."""
_BELOW = both(HandPlace((0.15, 0.2, 0.36), "floor", (0.8, 0.0, -0.4)))
_HALF = both(HandPlace((-0.02, -0.38, 0.3), "shoulder", (0.8, -0.5, -0.8)))
_OPENED_BELOW = both(HandPlace((0.25, 0.24, 0.32), "floor", (0.8, 0.0, -0.4)))
TABLE_M = 0.86
"""Metres over the floor of the wrists of who puts a load onto a table."""
_PUT_UP = {"table": (TABLE_M, 0.46), "shelf": (1.36, 0.42)}
"""Metres over the floor of the wrists that put a load there, and forward."""


def lift(rng: random.Random, *, heavy: bool = False) -> Gesture:
    """A load that is lifted from the floor with bent knees, and held before the belly.

    Args:
        rng: decides sizes and times.
        heavy: it is lifted slowly.
    """
    pace, starts = rng.uniform(0.95, 1.1) * (1.2 if heavy else 1.0), rng.uniform(0.2, 0.4)

    def sequel(feet: StandingFeet) -> Sequel:
        down, half, held = _stages(feet)
        done = Sequel([starts])
        done.carried(0.85 * pace, down, 0.25 * pace)
        done.then(0.5 * pace, half)
        done.then(0.5 * pace, held, 0.4)
        return done

    return on_feet(sequel, ["pick", "pick-both", "load-lifted"], rng.uniform(0.3, 0.6))


def put_down(rng: random.Random, onto: str = "floor", *, drops: bool = False) -> Gesture:
    """A load that is held before the belly, and put down: the lift reversed, or hands that reach out over a table.

    Args:
        rng: decides sizes and times.
        onto: floor, table or shelf.
        drops: the hands open, and the load falls.

    Raises:
        KeyError: no such place.
    """
    pace = rng.uniform(0.95, 1.1)

    def sequel(feet: StandingFeet) -> Sequel:
        down, half, held = _stages(feet)
        done = Sequel([0.0], [held])
        done.then(0.5, held)
        if drops:
            opened = both(HandPlace((0.12, -0.3, 0.28), "shoulder", _ELBOW))
            done.then(0.16, Posture((0.0, 0.92, -0.02), (4, 0, 0), (6, 0, 0), (10, 0, 0), hands=opened), 0.4)
        elif onto == "floor":
            done.then(0.5 * pace, half)
            done.then(0.55 * pace, down, 0.2)
            done.then(0.25, replace(down, hands=_OPENED_BELOW), 0.1)
        else:
            done = _onto(done, onto, pace)
        done.carried(0.85 * pace, Posture((0.0, 0.94, 0.0), feet={side: foot.flat() for side, foot in feet.items()}))
        return done

    return on_feet(sequel, ["pick-put", "load-put"], rng.uniform(0.4, 0.7))


def _stages(feet: StandingFeet) -> tuple[Posture, Posture, Posture]:
    """Return the postures of a load on the floor, on its way and before the belly."""
    stance = {side: foot.flat() for side, foot in feet.items()}
    wide: dict[str, Point] = dict.fromkeys(SIDES, (0.4, 0.1, 1.0))
    down = Posture((0.0, 0.52, -0.14), (34, 0, 0), (24, 0, 0), (-28, 0, 0), hands=_BELOW, feet=stance, knees=wide)
    half = Posture((0.0, 0.74, -0.1), (24, 0, 0), (14, 0, 0), (-20, 0, 0), hands=_HALF, feet=stance, knees=wide)
    held = Posture((0.0, 0.935, -0.02), (-3, 0, 0), (-3, 0, 0), (2, 0, 0), hands=_HELD, feet=stance)
    return down, half, held


def _onto(done: Sequel, onto: str, pace: float) -> Sequel:
    """Put the load onto a table or a shelf, and let it go."""
    up, far = _PUT_UP[onto]
    lean = 14.0 if onto == "table" else 2.0
    reached = Posture((0.0, 0.93, 0.0), (0.5 * lean, 0, 0), (0.7 * lean, 0, 0), (-0.3 * lean, 0, 0))
    there = both(HandPlace((0.15, up, far), "floor", _ELBOW))
    opened = both(HandPlace((0.24, up, far - 0.06), "floor", _ELBOW))
    done.then(0.75 * pace, replace(reached, hands=there), 0.2)
    done.then(0.25, replace(reached, hands=opened))
    return done
