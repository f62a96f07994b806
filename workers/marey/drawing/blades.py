"""Blades that stab and slash."""

from __future__ import annotations

import random

from marey.drawing.blows import Blow, Point, strike
from marey.drawing.gesture import BOTH, SIDES, Gesture
from marey.drawing.guards import begun, near, on_guard
from marey.drawing.stances import step
from marey.posing.standing import OTHER_SIDE, StandingBody

_STABS: dict[str, tuple[Point, Point, Point]] = {
    "stab-knife": ((0.16, -0.22, 0.22), (0.2, -0.24, -0.02), (0.04, -0.16, 0.52)),
    "stab-sword": ((0.14, -0.16, 0.3), (0.22, -0.14, 0.02), (0.04, -0.06, 0.54)),
    "stab-low": ((0.16, -0.3, 0.22), (0.22, -0.36, -0.02), (0.04, -0.3, 0.46)),
    "stab-spear": ((0.18, -0.3, 0.12), (0.2, -0.28, -0.1), (0.1, -0.2, 0.4)),
}
"""Where the hand with the weapon waits, is drawn back to, and thrusts."""


def stab(rng: random.Random, *, times: int | None = None) -> Gesture:
    form, side = rng.choices(list(_STABS), (3, 3, 2, 3))[0], rng.choice(SIDES)
    lead = rng.choice(SIDES) if form != "stab-spear" else OTHER_SIDE[side]
    ready, start, stance = begun(rng, lead)
    guard, back, end = (near(rng, place) for place in _STABS[form])
    number = times or rng.choices((1, 2, 3), (5, 2, 2))[0]
    lunges = rng.random() < 0.4
    stride = rng.uniform(0.28, 0.5)
    blows: list[Blow] = []
    begin = ready + rng.uniform(0.0, 0.5)
    front = near(rng, (0.04, -0.22, 0.34))
    for _ in range(number):
        hands: dict[str, tuple[Point, ...]] = {side: (back, near(rng, end, 0.04))}
        if form == "stab-spear":
            hands[OTHER_SIDE[side]] = ((front[0], front[1], front[2] - 0.12), (front[0] + 0.02, front[1] + 0.06, 0.52))
        blows.append(_thrust(rng, begin, hands, side, stride if lunges else 0.0))
        begin = blows[-1].end + rng.uniform(0.1, 0.6)
    seconds = begin + rng.uniform(0.4, 0.9)
    guards = {side: guard, OTHER_SIDE[side]: front if form == "stab-spear" else near(rng, (0.16, -0.2, 0.22))}
    lowers = stance is None and rng.random() < 0.8

    def change(body: StandingBody) -> None:
        way = on_guard(body, stance, start, seconds - 0.95 if lowers else None)
        for blow in blows if lunges else ():
            step(body, lead, (0.0, stride), blow.begin + 0.6 * blow.wind, blow.out + 0.4 * blow.wind)
            step(body, lead, (0.0, -stride), blow.hit + blow.stay, blow.back)
        strike(body, way, guards, blows)

    kinds = ["stab", form, *(["stab-lunge"] if lunges else [])]
    kinds += ["stab-hand"] if form != "stab-spear" else []
    kinds += ["stab-many"] if number > 1 else []
    acting = BOTH if form == "stab-spear" else side
    return Gesture(seconds + (0.4 if lowers else 0.0), tuple(kinds), change, acting, number)


def _thrust(rng: random.Random, begin: float, hands: dict[str, tuple[Point, ...]], side: str, lunge: float) -> Blow:
    """Draw one thrust; `lunge`: metres of the step that goes with it, 0 for none."""
    return Blow(
        begin,
        hands,
        wind=rng.uniform(0.22, 0.4),
        out=rng.uniform(0.16, 0.24),
        stay=rng.uniform(0.06, 0.4),
        back=rng.uniform(0.3, 0.55),
        side=side,
        twist=rng.uniform(16, 36),
        stoop=rng.uniform(6, 18),
        ahead=rng.uniform(0.3, 0.42) * lunge if lunge else rng.uniform(0.03, 0.08),
        pole=(0.7, -0.9, -0.4),
    )


_SLASHES: dict[str, tuple[Point, Point, Point]] = {
    "slash-down": ((0.12, 0.47, 0.08), (0.06, 0.3, 0.38), (0.0, -0.36, 0.38)),
    "slash-diagonal": ((0.34, 0.3, -0.04), (0.16, 0.1, 0.46), (-0.22, -0.36, 0.3)),
    "slash-across": ((0.52, 0.0, 0.02), (0.22, -0.04, 0.46), (-0.24, -0.08, 0.34)),
    "slash-back": ((-0.22, 0.06, 0.28), (0.12, -0.04, 0.48), (0.52, -0.16, 0.14)),
    "slash-up": ((0.34, -0.44, 0.04), (0.12, -0.12, 0.46), (-0.16, 0.26, 0.32)),
}
"""Where the hand with the blade is drawn back to, what it passes, and where its sweep ends."""
_TWO_HANDED = ("slash-down", "slash-down", "slash-diagonal", "slash-diagonal", "slash-across")


def slash(rng: random.Random, *, times: int | None = None) -> Gesture:
    side, lead = rng.choices(SIDES, (2, 3))[0], rng.choice(SIDES)
    ready, start, stance = begun(rng, lead)
    both = rng.random() < 0.4
    number = times or rng.choices((1, 2, 3), (5, 3, 2))[0]
    forms = _TWO_HANDED if both else tuple(_SLASHES)
    form = rng.choice(forms) if number == 1 or rng.random() < 0.4 else ""
    heavy = rng.random() < 0.4
    blows: list[Blow] = []
    begin = ready + rng.uniform(0.0, 0.5)
    for _ in range(number):
        kind = form or rng.choice(forms)
        places = tuple(near(rng, place) for place in _SLASHES[kind])
        if both:  # the other hand is next to it on the grip, so that neither gets far from the middle
            places = tuple((x, 1.1 * y, max(z, 0.26 - 0.35 * max(y, 0.0))) for x, y, z in places)
        hands: dict[str, tuple[Point, ...]] = {side: places}
        if both:
            hands[OTHER_SIDE[side]] = tuple((0.03 - x, y - 0.07, z - 0.02) for x, y, z in places)
        blows.append(_sweep(rng, kind, begin, hands, side, heavy=heavy))
        begin = blows[-1].end + rng.uniform(0.05, 0.5)
    seconds = begin + rng.uniform(0.4, 0.9)
    ahead = near(rng, (0.06, -0.2, 0.34))
    other = (0.03 - ahead[0], ahead[1] - 0.07, ahead[2] - 0.03) if both else near(rng, (0.18, -0.28, 0.16))
    guards = {side: ahead, OTHER_SIDE[side]: other}
    lowers = stance is None and rng.random() < 0.8

    def change(body: StandingBody) -> None:
        way = on_guard(body, stance, start, seconds - 0.95 if lowers else None)
        strike(body, way, guards, blows)

    kinds = ["slash", *([form] if form else []), "slash-both" if both else "slash-hand"]
    kinds += ["slash-many"] if number > 1 else []
    return Gesture(seconds + (0.4 if lowers else 0.0), tuple(kinds), change, BOTH if both else side, number)


def _sweep(
    rng: random.Random, kind: str, begin: float, hands: dict[str, tuple[Point, ...]], side: str, *, heavy: bool
) -> Blow:
    """Draw one sweep of a blade that the hands of both sides hold, or that of `side` alone."""
    both = len(hands) == 2
    turns = {"slash-back": -1.0, "slash-down": 0.2}.get(kind, 1.0)
    return Blow(
        begin,
        hands,
        wind=rng.uniform(0.5, 0.8) if heavy else rng.uniform(0.35, 0.55),
        out=rng.uniform(0.22, 0.27) if both else rng.uniform(0.24, 0.31),
        stay=rng.uniform(0.05, 0.3),
        back=rng.uniform(0.45, 0.75),
        side=side,
        twist=turns * (rng.uniform(30, 48) if both else rng.uniform(18, 38)),
        stoop=rng.uniform(14, 30) if kind in ("slash-down", "slash-diagonal") else rng.uniform(2, 12),
        ahead=rng.uniform(0.02, 0.08),
        coil=rng.uniform(0.8, 1.1) if both else 0.5,
        pole=(0.9, -0.6, -0.2),
    )
