"""Punches and blocks."""

from __future__ import annotations

import random

import numpy as np

from marey.drawing.blows import Blow, Point, strike
from marey.drawing.gesture import BOTH, SIDES, Gesture
from marey.drawing.guards import begun, near, on_guard
from marey.drawing.stances import settle, step
from marey.posing.standing import LEFT, OTHER_SIDE, RIGHT, StandingBody, envelope

_OUTWARD = (1.0, 0.1, -0.2)

_PUNCHES: dict[str, tuple[Point, Point, Point]] = {
    "straight": ((0.1, -0.07, 0.12), (0.0, -0.02, 0.54), (0.6, -0.6, -0.2)),
    "hook": ((0.34, -0.1, 0.1), (-0.12, 0.06, 0.41), _OUTWARD),
    "uppercut": ((0.12, -0.4, 0.1), (0.03, 0.17, 0.41), (0.4, -1.0, -0.3)),
}
"""Where a fist is drawn back to, where it strikes, and where the elbow points."""


def punch(rng: random.Random) -> Gesture:
    lead = rng.choices(SIDES, (3, 2))[0]
    ready, start, stance = begun(rng, lead)
    number = rng.choices((1, 2, 3, 4, 5), (5, 3, 2, 1, 1))[0]
    form = rng.choices(list(_PUNCHES), (5, 2, 2))[0] if rng.random() < 0.8 else ""
    hand = rng.choice(SIDES) if rng.random() < 0.6 else ""
    snap = rng.uniform(0.9, 1.25)
    blows: list[Blow] = []
    free: dict[str, float] = {LEFT: 0.0, RIGHT: 0.0}
    begin = ready + rng.uniform(0.0, 0.4)
    one = hand or rng.choice(SIDES)
    for _ in range(number):
        kind = form or rng.choice(list(_PUNCHES))
        begin = max(begin, free[one])
        blow = _blow(rng, kind, begin, one, snap, far=one != lead)
        blows.append(blow)
        free[one] = blow.end + rng.uniform(0.03, 0.5)
        begin = blow.hit + rng.uniform(0.05, 0.3)
        one = hand or OTHER_SIDE[one]
    seconds = max(free.values()) + rng.uniform(0.5, 1.1)
    guards = {one: near(rng, (0.08, -0.04, 0.3 if one == lead else 0.2)) for one in SIDES}
    lowers = stance is None and rng.random() < 0.8

    def change(body: StandingBody) -> None:
        way = on_guard(body, stance, start, seconds - 0.95 if lowers else None)
        strike(body, way, guards, blows)

    kinds = ["punch", *([f"punch-{form}"] if form else []), *(["punch-hand"] if hand else [])]
    kinds += ["punch-once"] if number == 1 else ["punch-many"]
    acting = {side for blow in blows for side in blow.hands}
    side = acting.pop() if len(acting) == 1 else BOTH
    return Gesture(seconds + (0.4 if lowers else 0.0), tuple(kinds), change, side, number)


def _blow(rng: random.Random, kind: str, begin: float, side: str, snap: float, *, far: bool) -> Blow:
    """Draw one punch.

    Args:
        kind: key of `_PUNCHES`.
        begin: seconds.
        side: of the fist, which is `far` if the other foot is ahead.
        snap: factor of its seconds.
    """
    back, end, pole = _PUNCHES[kind]
    return Blow(
        begin,
        {side: (near(rng, back), near(rng, end, 0.04))},
        wind=rng.uniform(0.12, 0.24) if kind == "straight" else rng.uniform(0.22, 0.32),
        out=rng.uniform(0.13, 0.18) * snap,
        stay=rng.uniform(0.04, 0.12),
        back=rng.uniform(0.22, 0.4) * snap,
        side=side,
        twist=rng.uniform(22, 40) if far or kind != "straight" else rng.uniform(8, 20),
        stoop=rng.uniform(0, 10),
        ahead=rng.uniform(0.02, 0.07),
        pole=pole,
    )


_BLOCKS: dict[str, tuple[dict[str, Point], Point]] = {
    "block-high": ({"acts": (-0.06, 0.26, 0.24)}, (1.0, 0.1, 0.2)),
    "block-middle": ({"acts": (-0.02, 0.04, 0.32)}, (0.5, -1.0, 0.0)),
    "block-shield": ({"acts": (-0.12, -0.1, 0.32)}, (1.0, -0.4, 0.1)),
    "block-face": ({"acts": (0.05, 0.07, 0.21), "other": (0.05, 0.05, 0.2)}, (0.4, -1.0, 0.1)),
    "block-cross": ({"acts": (-0.05, 0.05, 0.37), "other": (-0.06, -0.02, 0.26)}, (0.7, -0.9, 0.0)),
}
"""Where the hand that blocks and the other one go, and where the elbow points."""
_LOW_BLOCK: tuple[dict[str, Point], Point] = ({"acts": (0.08, -0.44, 0.24)}, (0.9, -0.3, -0.5))
"""The same of a sweep down before the thigh, which is drawn where it is asked for."""


def block(rng: random.Random, *, times: int | None = None, low: bool = False) -> Gesture:
    """A body that blocks, `times` or a few; `low`: below the hips."""
    form, side = rng.choices(list(_BLOCKS), (3, 3, 2, 2, 2))[0], rng.choice(SIDES)
    form = "block-low" if low else form
    number = times or rng.choices((1, 2, 3), (6, 2, 1))[0]
    stands = rng.random() < 0.45 and not low
    lead = rng.choice(SIDES)
    ready, start, stance = (0.1, -2.0, None) if stands else begun(rng, lead)
    goes, pole = _LOW_BLOCK if low else _BLOCKS[form]
    places = {(side if who == "acts" else OTHER_SIDE[side]): near(rng, place) for who, place in goes.items()}
    phases, seconds = [], ready + rng.uniform(0.1, 0.7)
    for _ in range(number):
        rise, hold, fall = rng.uniform(0.28, 0.42), rng.uniform(0.35, 1.5) / number**0.5, rng.uniform(0.35, 0.7)
        phases.append((seconds, rise, hold, fall))
        seconds += rise + hold + fall + rng.uniform(0.15, 0.6)
    seconds += rng.uniform(0.3, 0.7)
    guard = near(rng, (0.12, -0.26, 0.24), 0.05)
    sink, back, bent = rng.uniform(0.0, 0.06), rng.uniform(0.0, 0.05), rng.uniform(-10, 8)
    steps = stands and rng.random() < 0.5
    stride = rng.uniform(0.12, 0.3)
    foot = rng.choice(SIDES)

    def change(body: StandingBody) -> None:
        frames = len(body.joints)
        ways = [envelope(frames, *time) for time in phases]
        up = np.sum(ways, axis=0)
        if stance:
            stance(body, envelope(frames, start, 0.6, 60.0, 1.0))
        if steps:
            step(body, foot, (0.02, -stride), phases[0][0] - 0.1, 0.35)
            body.shift(np.zeros(frames), -0.4 * stride * envelope(frames, phases[0][0] - 0.1, 0.35, 60.0, 1.0))
        body.shift(-sink * up, -back * up)
        body.lean(bent * up, "left")
        settle(body)
        guarded = np.ones(frames) if start < 0 else envelope(frames, start, 0.6, 60.0, 1.0)
        for one in SIDES:
            place = np.tile(places.get(one, guard), (frames, 1))
            if not stands:
                w = (up if one in places else 0.0 * up)[:, None]
                poles = (1 - w) * [0.5, -1.0, -0.2] + w * pole
                body.hold(one, guarded, (1 - w) * guard + w * place, pole=poles)
            elif one in places:
                body.hold(one, up, place, lag=0.02, pole=pole)

    kinds = ["block", form, *(["block-hand"] if len(places) == 1 else [])]
    kinds += ["block-many"] if number > 1 else []
    return Gesture(seconds, tuple(kinds), change, BOTH if len(places) > 1 else side, number)
