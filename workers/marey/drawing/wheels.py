"""Drivers on a seat with both hands on a wheel."""

from __future__ import annotations

import math
import random
from dataclasses import replace

from marey.drawing.gesture import SIDES, Gesture
from marey.drawing.postures import FootPlace, HandPlace, Posture
from marey.drawing.sequels import Sequel
from marey.posing.standing import LEFT, RIGHT

_CARS = {
    "drive-car": {"seat": (0.4, 0.5), "lean": (-16, -6), "feet": (0.2, 0.3), "radius": (0.165, 0.19), "tilt": (20, 35)},
    "drive-truck": {
        "seat": (0.5, 0.58),
        "lean": (-6, 4),
        "feet": (0.0, 0.12),
        "radius": (0.2, 0.235),
        "tilt": (45, 62),
    },
    "drive-low": {
        "seat": (0.3, 0.36),
        "lean": (-24, -16),
        "feet": (0.36, 0.44),
        "radius": (0.15, 0.17),
        "tilt": (8, 20),
    },
}
"""Height of the hips, degrees by which the trunk leans, metres of the feet ahead of where they stood, radius of the
wheel, and degrees between the wheel and a wall."""
_STEP = 22.0
"""Degrees by which the wheel turns from one posture to the next at most."""
_RATES = {"calm": (45, 80), "": (80, 140), "hard": (140, 220)}
"""Degrees a second of the wheel."""


def _hands(degrees: float, wheel: tuple[float, float, float, float]) -> dict[str, HandPlace]:
    """Hands on a wheel turned to the right by degrees.

    Args:
        degrees: of the wheel.
        wheel: its radius, the height of its centre over the shoulders and its distance before them, and its tilt.
    """
    radius, up, ahead, tilt = wheel
    tilt = math.radians(tilt)
    hands = {}
    for side, sign in ((LEFT, 1.0), (RIGHT, -1.0)):
        angle = math.radians(degrees)
        rim = sign * radius * math.sin(angle)  # along the wheel, upward
        at = (radius * math.cos(angle), up + rim * math.cos(tilt), ahead + rim * math.sin(tilt))
        hands[side] = HandPlace(at, "trunk", (0.8, -1.0, -0.1))
    return hands


def drive(rng: random.Random) -> Gesture:
    form = rng.choices(list(_CARS), (5, 3, 2))[0]
    car = _CARS[form]
    seat, lean, feet, radius, tilt = (rng.uniform(*car[name]) for name in ("seat", "lean", "feet", "radius", "tilt"))
    manner = rng.choice(list(_RATES))
    most = {"calm": 30.0, "": 55.0, "hard": 72.0}[manner]
    wheel = (radius, rng.uniform(-0.22, -0.12), rng.uniform(0.37, 0.42), tilt)
    pedals = {
        LEFT: FootPlace((0.13, 0.09, feet), (0.1, 0.2 + feet, 0.9)),
        RIGHT: FootPlace((0.08, 0.09, feet + 0.03), (0.1, 0.2 + feet, 0.9)),
    }
    seated = Posture((0.0, seat, -rng.uniform(0.3, 0.36)), (lean, 0, 0), (rng.uniform(2, 10), 0, 0))
    seated = replace(seated, neck=(-0.5 * lean - 4, 0, 0), feet=pedals)
    seated = replace(seated, knees=dict.fromkeys(SIDES, (rng.uniform(0.1, 0.3), 1.0, 0.6)))

    def at(degrees: float, look: float) -> Posture:
        """The driver leans a little out of the turn and looks into it."""
        pressed = replace(pedals[RIGHT], at=(0.08, 0.09, feet + 0.03 + rng.choice((0.0, 0.02))))
        spine = (seated.spine[0], -0.05 * degrees, 0.0)
        neck = (seated.neck[0], 0.05 * degrees, look)
        return replace(seated, spine=spine, neck=neck, hands=_hands(degrees, wheel), feet={**pedals, RIGHT: pressed})

    turned, looks = 0.0, rng.random() < 0.4
    done = Sequel([rng.uniform(0.1, 0.5)], [at(0.0, 0.0)])
    end = rng.uniform(2.6, 7.8)
    sign = rng.choice((-1.0, 1.0))
    while done.times[-1] < end:
        goal = sign * rng.uniform(0.5, 1.0) * most if abs(turned) < 20 else rng.choice((0.0, -0.8 * turned))
        sign = -sign if rng.random() < 0.7 else sign
        look = rng.uniform(-45, 45) if looks and rng.random() < 0.5 else -0.25 * goal
        count = max(1, math.ceil(abs(goal - turned) / _STEP))
        seconds = abs(goal - turned) / rng.uniform(*_RATES[manner]) + 0.15
        begin = turned
        for k in range(count):
            turned = begin + (goal - begin) * (k + 1) / count
            done.then(seconds / count, at(turned, look))
        done.then(rng.uniform(0.15, 0.6), at(turned + rng.uniform(-4, 4), look))
        turned = goal
    kinds = ["drive", form, f"drive-{manner}" if manner else "", "drive-look" if looks else ""]
    return replace(done.gesture(rng, kinds), untrue="car" if form == "drive-truck" else "truck|bus")
