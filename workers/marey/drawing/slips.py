"""Feet that slip: they shoot away forward, and the body lands on its back or its seat, or catches itself."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import replace

from marey.drawing.falls import on_back
from marey.drawing.flights import StandingFeet, on_feet
from marey.drawing.gesture import SIDES, Gesture
from marey.drawing.postures import FootPlace, HandPlace, Point, Posture
from marey.drawing.sequels import Sequel
from marey.drawing.tumbling import BODY, OWN, Limb, Tumble, Whole, pair
from marey.posing.standing import LEFT, RIGHT

_FLUNG = Limb((0.52, 0.18, 0.16), towards=(0.5, -0.8, -0.3))
_WIDE = HandPlace((0.44, 0.12, 0.12), "shoulder", (0.3, -0.8, -0.5))
_THROWN_UP = HandPlace((0.3, 0.26, 0.22), "shoulder", (0.7, -0.7, -0.2))
_BALANCING = HandPlace((0.42, -0.12, 0.1), "shoulder", (0.3, -0.8, -0.5))
_SLIDES: Point = (0.1, -0.05, 1.0)


def slip(rng: random.Random, form: str = "back") -> Gesture:
    """A step whose foot shoots away forward, the other foot after it, and a fall onto the back.

    Args:
        rng: decides sizes and times.
        form: back, or sit: onto the seat, then the back.
    """
    far, starts = rng.uniform(0.3, 0.4), rng.uniform(0.5, 0.8)
    done = Tumble(times=[starts])
    steps = Whole((0.01, 0.13), 0.96, (4, 0, 0), (2, 0, 0), (10, 0, 0), feet={LEFT: Limb((0.0, 0.0, 0.3), OWN)})
    lifted = replace(steps, at=(-0.02, 0.05), feet={LEFT: Limb((0.0, 0.1, 0.14), OWN)})
    done.then(0.24, lifted)
    done.then(0.24, steps)
    shot = {LEFT: Limb((0.02, 0.02, 0.3 + far), OWN), RIGHT: Limb((0.0, 0.03, 0.08), OWN)}
    done.then(0.2, Whole((0.0, 0.24), 0.86, (-22, 0, 0), (4, 0, 0), (12, 0, 0), pair(_FLUNG), shot, splay=0.15))
    high = {
        side: Limb((0.12, -0.78 + 0.06 * late, 0.3 - 0.1 * late), BODY, (0.1, 0.1, 1.0))
        for side, late in ((LEFT, 0), (RIGHT, 1))
    }
    air = Whole((0.0, 0.3), 0.56, (-50, 0, 0), (10, 0, 0), (18, 0, 0), pair(_FLUNG), high, splay=0.15)
    done.then(0.2, air, fall=True)
    lies = on_back(rng, (rng.uniform(-0.05, 0.05), rng.uniform(0.2, 0.3)))
    if form == "sit":
        _onto_seat(done, lies)
    up = {side: Limb((0.14, -0.76, 0.24), BODY, (0.1, 0.1, 1.0)) for side in SIDES}
    hands = {side: replace(limb, at=(0.52, 0.02, -0.02)) for side, limb in lies.hands.items()}
    done.then(0.24, replace(lies, spine=(6, 0, 0), neck=(14, 0, 0), hands=hands, feet=up), fall=True)
    done.then(rng.uniform(0.36, 0.46), replace(lies, neck=(4, 0, 0.5 * lies.neck[2])))
    done.then(0.3, lies, rng.uniform(0.6, 1.6))
    turned = done if rng.random() < 0.5 else done.mirrored()
    return turned.gesture(rng, ["die", "die-back", "die-on-back", "slip"], untrue=r"\b(forward|face)|\bshot|kill|knock")


def _onto_seat(done: Tumble, lies: Whole) -> None:
    """Land on the seat, the hands behind it, before the trunk goes down."""
    hands = pair(Limb((0.32, -0.4, -0.16), towards=(0.7, -0.3, -0.8)))
    feet = {side: Limb((0.14, -0.4, 0.68), BODY, (0.1, 0.9, 0.3)) for side in SIDES}
    seat = Whole(lies.at, 0.15, (-22, 0, 0), (16, 0, 0), (14, 0, 0), hands, feet, rest=1.0, splay=0.3)
    done.then(0.22, seat, fall=True)
    done.then(0.25, replace(seat, tilt=(-28, 0, 0)))


def slip_caught(rng: random.Random) -> Gesture:
    """A foot that shoots forward; the arms fly up, the trunk goes back, and the body catches itself over both feet."""
    far, starts, pace = rng.uniform(0.34, 0.42), rng.uniform(0.4, 0.6), rng.uniform(0.95, 1.1)
    return on_feet(_caught(far, starts, pace), ["stumble", "slip"], rng.uniform(0.4, 0.7), mirror=rng.random() < 0.5)


def _caught(far: float, starts: float, pace: float) -> Callable[[StandingFeet], Sequel]:
    """Return the postures of a slip that is caught, over the feet of an idle."""

    def sequel(feet: StandingFeet) -> Sequel:
        def slid(forward: float, heel: float = 0.0) -> dict[str, FootPlace]:
            ahead = replace(feet[LEFT].flat(forward), drags=True, toes=_SLIDES if forward > 0.2 else None)
            return {LEFT: ahead, RIGHT: feet[RIGHT].tiptoe(heel) if heel else feet[RIGHT].flat()}

        done = Sequel([starts])
        step = {LEFT: feet[LEFT].flat(0.16), RIGHT: feet[RIGHT].flat()}
        done.then(0.36, Posture((0.0, 0.92, 0.08), (4, 0, 0), (2, 0, 0), feet=step))
        shot = Posture((-0.04, 0.82, 0.04), (-14, 0, 8), (-8, 6, 4), (16, 0, -6), feet=slid(0.16 + far))
        done.then(0.26, replace(shot, hands={LEFT: _THROWN_UP, RIGHT: _WIDE}))
        pitched = replace(shot, pelvis=(-0.02, 0.8, 0.12), tilt=(12, -4, 0), spine=(20, -8, 0), neck=(-14, 0, 0))
        done.then(0.34 * pace, replace(pitched, hands={LEFT: _WIDE, RIGHT: _THROWN_UP}))
        sways = replace(shot, pelvis=(0.02, 0.83, 0.16), tilt=(-3, 5, 0), spine=(2, 8, 0), neck=(4, 0, 0))
        done.then(0.38 * pace, replace(sways, hands={LEFT: _BALANCING, RIGHT: _WIDE}))
        sunk = replace(shot, pelvis=(0.0, 0.84, 0.2), tilt=(6, 0, 0), spine=(8, 0, 0), neck=(-4, 0, 0))
        done.then(0.4 * pace, replace(sunk, hands={LEFT: _BALANCING, RIGHT: _BALANCING}), 0.2)
        end = 0.16 + far
        closes = {LEFT: feet[LEFT].flat(end), RIGHT: feet[RIGHT].flat(0.6 * end, 0.06)}
        done.then(0.34 * pace, Posture((0.02, 0.89, 0.8 * end), (4, 0, 0), (4, 0, 0), feet=closes))
        done.then(
            0.34 * pace, Posture((0.0, 0.935, end), feet={one: foot.flat(end) for one, foot in feet.items()}), 0.3
        )
        return done

    return sequel
