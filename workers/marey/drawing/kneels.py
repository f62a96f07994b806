"""Bodies that kneel on one knee or both."""

from __future__ import annotations

import math
import random
from dataclasses import replace

from marey.drawing.gesture import SIDES, Gesture
from marey.drawing.postures import STAND, FootPlace, HandPlace, Point, Posture
from marey.drawing.sequels import FLOOR_PACES, Sequel, both
from marey.posing.standing import LEFT, RIGHT

_BACK = FootPlace((0.1, 0.15, -0.66), (0.0, -0.93, 0.35))
_FLAT = FootPlace((0.1, 0.085, -0.66), (0.0, -0.3, -0.95))
_KNEE: Point = (0.05, -0.3, 1.0)
_PRAYS = {
    "kneel-hang": {},
    "kneel-thighs": both(HandPlace((-0.02, 0.14, -0.13), "knee", (0.7, -0.2, -0.7))),
    "kneel-clasped": both(HandPlace((-0.155, -0.06, 0.26), "trunk", (0.7, -1.0, 0.0))),
    "kneel-front": {RIGHT: HandPlace((-0.02, 0.07, -0.03), "knee", (0.7, -0.3, -0.6))},
}


def kneeling(rng: random.Random, *, one: bool) -> tuple[Posture, Posture, Posture]:
    """Return a body on its way to its knees, on the left one, and on the one or both: kneeling for good."""
    pelvis: Point = (0.0, rng.uniform(0.51, 0.525), -rng.uniform(0.23, 0.27))
    half = Posture(pelvis, spine=(rng.uniform(0, 8), 0, 0), hang=0.8, feet={LEFT: _BACK}, knees={LEFT: _KNEE})
    way = replace(half, pelvis=(0.0, 0.72, -0.2), tilt=(12, 0, 0), spine=(14, 0, 0))
    low = replace(half, feet=dict.fromkeys(SIDES, _BACK), knees=dict.fromkeys(SIDES, _KNEE)) if not one else half
    hands = _PRAYS["kneel-front" if one else rng.choice(("kneel-hang", "kneel-thighs"))]
    return way, half, replace(low, hands=hands)


def kneel(rng: random.Random) -> Gesture:
    """The left knee goes down, or both do, the left one first; mirrored by chance."""
    one = rng.random() < 0.5
    heels = not one and rng.random() < 0.4
    hands = rng.choices(list(_PRAYS), (3, 2, 3, 3 if one else 0))[0]
    if one and hands == "kneel-thighs":
        hands = "kneel-front"
    pelvis: Point = (0.0, rng.uniform(0.51, 0.525), -rng.uniform(0.23, 0.27))
    lean = rng.uniform(-3, 12)
    half = Posture(pelvis, (rng.uniform(-2, 4), 0, 0), (lean, 0, 0), (rng.uniform(-4, 18), 0, 0), 0.8)
    half = replace(half, feet={LEFT: _BACK}, knees={LEFT: _KNEE})
    way = replace(half, pelvis=(0.0, 0.72, -0.2), tilt=(12, 0, 0), spine=(14, 0, 0))
    low = replace(half, feet=dict.fromkeys(SIDES, _BACK), knees=dict.fromkeys(SIDES, _KNEE)) if not one else half
    if heels:
        height = rng.uniform(0.34, 0.4)
        sat: Point = (0.0, height, -0.26 - math.sqrt(0.39**2 - (height - 0.14) ** 2))
        low = replace(low, pelvis=sat, feet=dict.fromkeys(SIDES, _FLAT))
    low = replace(low, hands=_PRAYS[hands])
    begin = rng.choices(["stand", "kneel"], (3, 1))[0]
    pace = rng.uniform(*FLOOR_PACES[rng.choice(["quick", "", "", "slow"])])
    done = Sequel([rng.uniform(0.15, 0.7)])
    if begin == "kneel":
        done = Sequel([rng.uniform(0.15, 0.7)], [low])
    else:
        done.then(0.5 * pace, way)
        done.then(0.4 * pace, half if not one else replace(half, hands=low.hands))
        if not one:
            done.then(0.75 * pace, low if not heels else replace(low, pelvis=half.pelvis))
        if heels:
            done.then(0.5 * pace, low)
    end = done.times[-1] + rng.uniform(0.9, 2.0)
    while done.times[-1] < end:
        spine, neck = (lean + rng.uniform(-4, 6), rng.uniform(-2, 2), rng.uniform(-6, 6)), (rng.uniform(-6, 16), 0, 0)
        done.then(rng.uniform(0.6, 1.1), replace(low, spine=spine, neck=neck), rng.uniform(0.1, 0.6))
    rises = begin == "stand" and rng.random() < 0.5
    if rises:
        if not one:
            done.then(0.8 * pace, half)
        done.then(0.45 * pace, replace(way, hands={RIGHT: _PRAYS["kneel-front"][RIGHT]}))
        done.then(0.55 * pace, STAND)
    down = "kneel-down" if begin == "stand" else "kneel-stay"
    kinds = ["kneel", "kneel-one" if one else "kneel-both", down]
    kinds += ["kneel-clasped" if hands == "kneel-clasped" else "", "kneel-up" if rises else ""]
    side = rng.choice(SIDES)
    told = done if side == LEFT else done.mirrored()
    return told.gesture(rng, kinds, side if one else "")
