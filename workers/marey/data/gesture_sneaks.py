"""Sneaking made of captured walks: slower, the knees bent, the trunk forward, the feet lifted higher."""

from __future__ import annotations

import random

import numpy as np

from marey.data.gesture_travel import gentle_bend, straight_gait
from marey.drawing.gesture import SIDES, Gesture
from marey.posing.standing import StandingBody

_PACES = (0.58, 0.9)
_SPEEDS = (0.34, 1.0)  # m/s
_SLOW, _LOW, _HUNCHED = 0.5, 0.17, 29.0  # m/s, metres, degrees from which a sneak is called so
_FEET = ((7, 10), (8, 11))
_HEAD_UP = 0.6  # degrees of the neck back per degree of the trunk


def sneak(rng: random.Random) -> Gesture:
    speed, seconds = rng.uniform(*_SPEEDS), rng.uniform(2.5, 8.5)
    lower, stoop, higher = rng.uniform(0.07, 0.3), rng.uniform(12, 44), rng.uniform(0.3, 1.1)
    hands = [np.array([rng.uniform(0.06, 0.2), rng.uniform(-0.36, -0.12), rng.uniform(0.2, 0.36)]) for _ in SIDES]
    held, steady = rng.random() < 0.7, rng.uniform(0.2, 0.7)

    def change(body: StandingBody) -> None:
        whole = np.ones(len(body.joints))
        body.steady(steady)
        body.shift(-lower * whole, -0.35 * lower - 0.0015 * stoop)
        body.lean(stoop * whole, "left", (0, 3, 6, 9))
        body.turn(12, "left", -_HEAD_UP * stoop * whole)
        for ankle, toe in _FEET:
            height = body.joints[:, toe, 1] - body.joints[:, toe, 1].min()
            body.joints[:, [ankle, toe], 1] += (higher * np.maximum(height - 0.02, 0.0))[:, None]
        if held:
            for side, point in zip(SIDES, hands, strict=True):
                body.hold(side, whole, point)

    low = lower > _LOW
    kinds = [name for name, applies in (("sneak-low", low), ("sneak-hunched", stoop > _HUNCHED)) if applies]
    kinds += ["sneak-slow"] if speed < _SLOW else []
    base = straight_gait(rng, seconds, speed, _PACES, gentle_bend(rng))
    untrue = r"tip.?toe|pussyfoot" + ("" if low else "|crouch")
    return Gesture(seconds, ("sneak", *kinds), change, base=base, untrue=untrue)
