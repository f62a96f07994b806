"""Guns that are aimed and balls that are shot at a basket."""

from __future__ import annotations

import random

import numpy as np
from numpy.typing import NDArray

from marey.drawing.gesture import BOTH, SIDES, Gesture
from marey.drawing.parts import GesturePace, respond
from marey.posing.standing import LEFT, OTHER_SIDE, StandingBody, eased, envelope, stations

Array = NDArray[np.floating]

_ELBOW_OUT = (1.0, -0.7, -0.2)


def aim(rng: random.Random) -> Gesture:
    form = rng.choices(["aim-rifle", "aim-pistol", "aim-one"], (5, 4, 3))[0]
    side = rng.choices(SIDES, (1, 2))[0]
    if rng.random() < 0.45:
        seconds, kinds = rng.uniform(2.0, 7.0), ("aim", form)
        pace = GesturePace.lasting(seconds)
    else:
        pace = GesturePace.draw(rng, (0.3, 0.9), (0.8, 4.0))
        seconds, kinds = pace.total(rng), ("aim", form, "aim-raise")
    hands, twist, head = GUNS[form](rng, side), TWISTS[form], rng.uniform(0, 7)
    degrees, turned = rng.uniform(*twist), OTHER_SIDE[side] if form == "aim-rifle" else side
    stoop = rng.uniform(0, 7)

    def change(body: StandingBody) -> None:
        way = pace.way(body)
        body.lean(stoop * way, "left")
        respond(body, way, turned, degrees, 0.0)
        back = (1.0 if turned == LEFT else -1.0) * degrees
        body.lean(0.8 * back * way, "up", (12,))
        body.lean(head * way, "left", (12,))
        for one, (point, pole) in hands.items():
            body.hold(one, way, point, lag=0.04, pole=pole)

    return Gesture(seconds, kinds, change, side if form == "aim-one" else BOTH)


TWISTS = {"aim-rifle": (10, 28), "aim-pistol": (-4, 8), "aim-one": (4, 20)}
"""Degrees by which the trunk turns the leading shoulder forward."""
Hands = dict[str, tuple[Array, tuple[float, float, float]]]
"""The point of each hand, see `StandingBody.hold`, and where its elbow points."""


def _rifle(rng: random.Random, side: str) -> Hands:
    """`side` is the hand at the trigger, near the chin; the other supports the barrel ahead."""
    up, bend = rng.uniform(-0.06, 0.1), rng.uniform(-0.08, 0.04)
    trigger = np.array([rng.uniform(0.02, 0.08), up + bend, rng.uniform(0.16, 0.24)])
    barrel = np.array([-rng.uniform(0.0, 0.06), up, rng.uniform(0.45, 0.54)])
    down = (0.5, -1.0, -0.2)
    return {side: (trigger, rng.choice((_ELBOW_OUT, (0.7, -1.0, -0.3)))), OTHER_SIDE[side]: (barrel, down)}


def _pistol(rng: random.Random, side: str) -> Hands:
    up, ahead, aside = rng.uniform(-0.12, 0.12), rng.uniform(0.41, 0.48), rng.uniform(-0.03, 0.04)
    grip, support = np.array([aside, up, ahead]), np.array([0.05 - aside, up - 0.015, ahead - 0.02])
    pole = (0.9, -1.0, -0.2)
    return {side: (grip, pole), OTHER_SIDE[side]: (support, pole)}


def _one_hand(rng: random.Random, side: str) -> Hands:
    point = np.array([rng.uniform(0.08, 0.2), rng.uniform(-0.1, 0.12), rng.uniform(0.48, 0.56)])
    return {side: (point, (0.7, -1.0, -0.3))}


GUNS = {"aim-rifle": _rifle, "aim-pistol": _pistol, "aim-one": _one_hand}


def shoot_basket(rng: random.Random) -> Gesture:
    side = rng.choice(SIDES) if rng.random() < 0.5 else BOTH
    start, lift, wait = rng.uniform(0.1, 1.0), rng.uniform(0.4, 0.7), rng.uniform(0.15, 0.9)
    push, follow, fall = rng.uniform(0.4, 0.65), rng.uniform(0.25, 0.8), rng.uniform(0.5, 0.9)
    deep = rng.random() < 0.5
    dip = rng.uniform(0.07, 0.13) if deep else rng.uniform(0.02, 0.05)
    heels = rng.uniform(20, 34) if deep else rng.choice([0.0, rng.uniform(8, 18)])
    begin = start + lift + wait
    apart, far = rng.uniform(0.07, 0.12), rng.uniform(0.46, 0.51)
    above = np.radians(rng.uniform(52, 68))
    chest = (apart, rng.uniform(-0.26, -0.12), rng.uniform(0.22, 0.3))
    brow = (apart, rng.uniform(0.2, 0.3), rng.uniform(0.1, 0.18))
    goal = (apart + 0.04, far * np.sin(above), far * np.cos(above))

    def change(body: StandingBody) -> None:
        frames = len(body.joints)
        t = np.arange(frames) / 20
        way = envelope(frames, start, lift, wait + push + follow, fall)
        low = envelope(frames, begin - 0.4, 0.4, 0.0, 0.6 * push)
        body.shift(-dip * low)
        body.rise_on_toes(heels * envelope(frames, begin + 0.35 * push, 0.55 * push, 0.15, 0.45))
        body.lean(60 * dip * low, "left")
        body.lean(-10 * eased((t - begin) / push) * way, "left", (12,))
        w = eased((t - begin) / push)[:, None]
        shot = (1 - w) ** 2 * np.array(chest) + 2 * w * (1 - w) * np.array(brow) + w**2 * np.array(goal)
        for one in SIDES:
            point = shot
            if side not in (one, BOTH):  # the guiding hand leaves the ball early
                point = shot + stations(frames, (0.0, begin + 0.5 * push, begin + push), _GUIDING)
            body.hold(one, way, point, lag=0.03, pole=(0.5, -1.0, 0.1))

    kinds = ("basket", "basket-deep" if deep else "basket-flat", *(["basket-led"] if side != BOTH else []))
    return Gesture(begin + push + follow + fall + rng.uniform(0.25, 1.0), kinds, change, side)


_GUIDING = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.04, -0.07, -0.03))
