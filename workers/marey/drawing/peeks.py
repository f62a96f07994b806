"""Bodies that lean out to a side to see past something, and hands that catch a ball."""

from __future__ import annotations

import random
from dataclasses import replace

from marey.drawing.flights import StandingFeet, on_feet
from marey.drawing.gesture import SIDES, Gesture
from marey.drawing.postures import HandPlace, Point, Posture
from marey.drawing.sequels import Sequel, both
from marey.posing.standing import LEFT, OTHER_SIDE, RIGHT

_DOWN: Point = (0.6, -1.0, -0.3)
_KNEES: dict[str, Point] = dict.fromkeys(SIDES, (0.45, 0.1, 1.0))


def peek(rng: random.Random, side: str = "", *, low: bool = False, looks: bool = True) -> Gesture:
    """A body that shifts its weight to a side, leans trunk and head out to it, stays for a moment and comes back.

    Args:
        rng: decides sizes and times.
        side: to which it leans; empty = either.
        low: it crouches first, and stays so.
        looks: the head stays level and looks ahead.
    """
    side = side or rng.choice(SIDES)
    pace, starts, holds = rng.uniform(0.9, 1.1), rng.uniform(0.3, 0.5), rng.uniform(1.0, 1.6)
    lean, up = rng.uniform(17, 21), 0.62 if low else 0.9
    level = 1.0 if looks else 0.4

    def sequel(feet: StandingFeet) -> Sequel:
        """Lean to the right."""
        wide = {LEFT: feet[LEFT].flat(), RIGHT: replace(feet[RIGHT], out=feet[RIGHT].out + 0.16).flat()}
        pitch = 16.0 if low else 3.0
        rests = both(HandPlace((0.02, 0.1, 0.0), "knee", (0.8, -0.3, -0.5))) if low else {}
        hands = rests or {LEFT: HandPlace((0.2, -0.42, 0.1), "shoulder", _DOWN)}
        before = Posture(
            (-0.07, up, -0.1 if low else 0.0), (pitch, 0, 0), (pitch, 0, 0), (-1.6 * pitch, 0, 0), hands=rests
        )
        before = replace(before, feet=wide, knees=_KNEES if low else {})
        out = replace(
            before,
            pelvis=(-0.17, up - 0.02, -0.1 if low else 0.0),
            tilt=(pitch, 0.4 * lean, 0),
            spine=(pitch, 1.2 * lean, 0),
            neck=(-1.6 * pitch, -level * lean, -8 * level),
            hands={} if low else hands,
        )
        done = Sequel([starts])
        done.then((0.8 if low else 0.45) * pace, before, 0.35 if low else 0.1)
        done.then(0.5 * pace, out, holds)
        done.then(0.5 * pace, before, 0.4 if low else 0.0)
        if not low:
            done.then(0.45, Posture((0.0, 0.94, 0.0), feet={one: foot.flat() for one, foot in feet.items()}))
        return done

    return on_feet(sequel, ["peek"], rng.uniform(0.3, 0.6), side=side, mirror=side == LEFT)


def catch(rng: random.Random, side: str = "", *, high: bool = False) -> Gesture:
    """Hands that reach out for a ball, close on it, give as it arrives, and hold it before the belly.

    Args:
        rng: decides sizes and times.
        side: of the only hand that catches; empty = both do.
        high: over the head.
    """
    pace, starts = rng.uniform(0.95, 1.1), rng.uniform(0.4, 0.7)
    reach = (0.3, 0.3) if high else (-0.04, 0.42)  # up and forward of the shoulder
    acting = (side,) if side else SIDES
    way = {
        "ready": HandPlace((-0.04, -0.24, 0.28), "shoulder", _DOWN),
        "out": HandPlace((-0.07, *reach), "shoulder", _DOWN),
        "gives": HandPlace((-0.08, reach[0] - 0.14, reach[1] - 0.16), "shoulder", _DOWN),
        "held": HandPlace((-0.08, -0.28, 0.22), "shoulder", _DOWN),
    }

    def sequel(feet: StandingFeet) -> Sequel:
        hands = {name: dict.fromkeys(acting, place) for name, place in way.items()}
        if side:
            free = HandPlace((0.18, -0.4, 0.12), "shoulder", _DOWN)
            hands = {name: {**put, OTHER_SIDE[side]: free} for name, put in hands.items()}
        stance = {LEFT: feet[LEFT].flat(0.16), RIGHT: feet[RIGHT].flat()}
        gaze = -22.0 if high else 0.0
        ready = Posture((0.0, 0.88, 0.05), (6, 0, 0), (8, 0, 0), (-6 + gaze, 0, 0), hands=hands["ready"], feet=stance)
        out = replace(ready, pelvis=(0.0, 0.92, 0.11), tilt=(6, 0, 0), spine=(6, 0, 0), hands=hands["out"])
        gives = replace(ready, pelvis=(0.0, 0.88, 0.05), tilt=(0, 0, 0), spine=(0, 0, 0), hands=hands["gives"])
        held = replace(ready, pelvis=(0.0, 0.91, 0.07), neck=(10, 0, 0), hands=hands["held"])
        done = Sequel([starts])
        done.then(0.5 * pace, ready, 0.3)
        done.then(0.3 * pace, out, 0.05)
        done.then(0.2, gives)
        done.then(0.35 * pace, held, 0.6)
        held_up = {one: foot.flat() for one, foot in feet.items()}
        done.then(0.6 * pace, Posture((0.0, 0.94, 0.0), hands=hands["held"], feet=held_up))
        return done

    return on_feet(sequel, ["catch"], rng.uniform(0.4, 0.8), side=side)
