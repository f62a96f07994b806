"""Spells that are cast with one hand, both hands or a staff."""

from __future__ import annotations

import random
from dataclasses import replace

from marey.drawing.gesture import BOTH, SIDES, Gesture
from marey.drawing.postures import STAND, FootPlace, HandPlace, Point, Posture
from marey.drawing.sequels import Sequel, near
from marey.posing.standing import LEFT, RIGHT

_OUT: Point = (0.8, -0.8, -0.3)
_Hands = dict[str, HandPlace]


def _put(left: Point, right: Point, elbow: Point = _OUT) -> _Hands:
    return {LEFT: HandPlace(left, "trunk", elbow), RIGHT: HandPlace(right, "trunk", elbow)}


def _near_hands(rng: random.Random, hands: _Hands, far: float) -> _Hands:
    return {side: replace(hand, at=near(rng, hand.at, far)) for side, hand in hands.items()}


_AHEAD = _put((0.08, -0.06, 0.5), (0.08, -0.06, 0.5))
_LOW = _put((0.26, -0.34, 0.16), (0.26, -0.34, 0.16))
_HIGH = _put((0.2, 0.38, 0.16), (0.2, 0.38, 0.16), elbow=(1.0, 0.1, 0.1))
_CASTS = {
    "cast-push": (_put((0.12, -0.14, 0.15), (0.12, -0.14, 0.15)), _AHEAD),
    "cast-hip": (_put((-0.1, -0.3, 0.18), (0.22, -0.34, 0.08)), _AHEAD),
    "cast-one": (
        {RIGHT: HandPlace((0.16, -0.08, 0.1), "trunk", _OUT)},
        {RIGHT: HandPlace((0.08, 0.04, 0.53), "trunk", _OUT)},
    ),
    "cast-overhead": (_put((0.08, 0.36, 0.12), (0.08, 0.36, 0.12), elbow=(1.0, 0.3, 0.2)), _AHEAD),
    "cast-rise": (_LOW, _HIGH),
    "cast-staff": (
        {RIGHT: HandPlace((0.12, -0.2, 0.26), "trunk", _OUT)},
        {RIGHT: HandPlace((0.14, 0.4, 0.2), "trunk", (1.0, -0.2, 0.2))},
    ),
    "cast-spread": (
        _put((0.06, -0.1, 0.2), (0.06, -0.1, 0.2), elbow=(1.0, -0.4, -0.1)),
        _put((0.46, 0.06, 0.14), (0.46, 0.06, 0.14), elbow=(0.1, -1.0, -0.3)),
    ),
}
"""Hands while a spell gathers, and when it is sent off; one hand is the right one."""


def cast_spell(rng: random.Random, *, times: int | None = None) -> Gesture:
    form = rng.choices(list(_CASTS), (5, 3, 5, 2, 4, 3, 2))[0]
    gather, send = (_near_hands(rng, hands, 0.03) for hands in _CASTS[form])
    slow = form in ("cast-rise", "cast-staff") and rng.random() < 0.6
    times = times or rng.choices((1, 2, 3), (6, 2, 1))[0]
    lifts = form in ("cast-rise", "cast-staff", "cast-spread")
    steps = not lifts and rng.random() < 0.45
    turn = {"cast-hip": -rng.uniform(18, 34), "cast-one": -rng.uniform(8, 24)}.get(form, 0.0)
    stoop, lean = rng.uniform(4, 14), rng.uniform(4, 16) if not lifts else -rng.uniform(0, 8)
    dip = rng.uniform(0.02, 0.09)
    feet = {LEFT: FootPlace((0.1, 0.07, rng.uniform(0.18, 0.3)))} if steps else {}
    wait = Posture((0.0, 0.93 - dip, -0.02), (0.4 * stoop, 0, 0), (stoop, 0, turn), (-0.5 * stoop, 0, -0.7 * turn))
    wait = replace(wait, hands=gather)
    forward = 0.4 * feet[LEFT].at[2] if steps else 0.02
    cast = Posture((0.0, 0.92 - 0.4 * dip - (0.03 if steps else 0.0), forward), (0.4 * lean, 0, 0))
    cast = replace(cast, spine=(0.6 * lean, 0, -0.5 * turn), neck=(-0.3 * lean if not lifts else -8, 0, 0.3 * turn))
    cast = replace(cast, hands=send, feet=feet)
    done = Sequel([rng.uniform(0.1, 0.7)])
    for k in range(times):
        again = replace(wait, feet=feet, pelvis=cast.pelvis)
        done.then(rng.uniform(0.4, 0.6) if k else rng.uniform(0.45, 0.8), again if k else wait)
        charge = rng.uniform(0.2, 1.1) if not k else 0.15
        begin = done.times[-1]
        while done.times[-1] < begin + charge:  # hands tremble with what they gather
            shaken = _near_hands(rng, gather, 0.02)
            done.then(rng.uniform(0.2, 0.35), replace(done.postures[-1], hands=shaken))
        done.then(rng.uniform(0.6, 1.1) if slow else rng.uniform(0.18, 0.32), cast)
        hold = rng.uniform(0.4, 1.8) if times == 1 else rng.uniform(0.35, 0.7)
        held = done.times[-1] + hold
        while done.times[-1] < held:
            shaken = _near_hands(rng, send, 0.012)
            done.then(rng.uniform(0.25, 0.4), replace(cast, hands=shaken))
    done.then(rng.uniform(0.5, 0.9), STAND)
    one = form in ("cast-one", "cast-staff")
    right = rng.random() < 0.6
    side = (SIDES[1] if right else SIDES[0]) if one else BOTH
    kinds = ["cast" if not lifts else "cast-calm", form, "cast-many" if times > 1 else "", "cast-step" if steps else ""]
    gesture = (done if right else done.mirrored()).gesture(rng, kinds, side, times)
    return replace(gesture, untrue="fireball|attack|blast|shoot|hurl|lightning" if lifts else "power up|summon|enchant")
