"""Drivers on a seat with both hands on a wheel."""

from __future__ import annotations

import math
import random
from dataclasses import dataclass, replace

from marey.drawing.gesture import SIDES, Gesture
from marey.drawing.postures import FootPlace, HandPlace, Posture
from marey.drawing.sequels import Sequel
from marey.posing.standing import LEFT, RIGHT, SIGN

_CARS = {
    "drive-car": {
        "seat": (0.42, 0.5),
        "lean": (-16, -6),
        "feet": (0.2, 0.3),
        "radius": (0.165, 0.19),
        "tilt": (20, 35),
    },
    "drive-truck": {
        "seat": (0.5, 0.58),
        "lean": (-6, 4),
        "feet": (0.0, 0.12),
        "radius": (0.2, 0.235),
        "tilt": (45, 62),
    },
    "drive-low": {
        "seat": (0.37, 0.41),
        "lean": (-24, -16),
        "feet": (0.36, 0.44),
        "radius": (0.15, 0.17),
        "tilt": (8, 20),
    },
}
"""Height of the hips, degrees by which the trunk leans, metres of the feet ahead of where they stood, radius of the
wheel, and degrees between the wheel and a wall."""
_HEEL, _TOES = 0.07, (0.1, -0.15, 0.95)
"""Metres of an ankle over the floor, and where the toes point: a heel stands on the floor before a pedal, and the toes
are so low that the floor is found below them."""
_TRUNK = 0.46
"""Metres from the hips to the middle of the shoulders."""
_FOLLOWS = 0.2
"""Share of a look by which the shoulders follow; the hips stay."""
_STEP = 22.0
"""Degrees by which the wheel turns from one posture to the next at most."""
_RATES = {"calm": (45, 80), "": (80, 140), "hard": (140, 220)}
"""Degrees a second of the wheel."""


@dataclass(frozen=True)
class _Wheel:
    """A steering wheel, which stays where it is.

    Attributes:
        radius: in metres.
        up, ahead: of its centre, metres over the floor and ahead of where the body stood.
        tilt: degrees between it and a wall.
        grip: degrees by which the hands hold it above its middle: 30 is ten to two.
    """

    radius: float
    up: float
    ahead: float
    tilt: float
    grip: float

    def hand(self, side: str, degrees: float) -> HandPlace:
        """Return the hand of a side on the wheel turned to the right by degrees."""
        angle, tilt = math.radians(self.grip + SIGN[side] * degrees), math.radians(self.tilt)
        rim = self.radius * math.sin(angle)  # along the wheel, upward
        at = (self.radius * math.cos(angle), self.up + rim * math.cos(tilt), self.ahead + rim * math.sin(tilt))
        return HandPlace(at, "floor", (0.8, -1.0, -0.1))


@dataclass(frozen=True)
class Way:
    """How a driver drives; what is empty is drawn at random.

    Attributes:
        car: a key of the cars: drive-car, drive-truck or drive-low.
        manner: calm, hard, or empty for neither; None = at random.
        turns: sides to which the wheel is turned, in turn.
        sharp: it is turned far.
        looks: now and then to a side; None = at random.
        lets_go: what a hand does that leaves the wheel: `shift` or `rest`.
        side: of that hand.
        seconds: for about how long.
    """

    car: str = ""
    manner: str | None = None
    turns: tuple[str, ...] = ()
    sharp: bool = False
    looks: bool | None = None
    lets_go: str = ""
    side: str = RIGHT
    seconds: float | None = None


_FREE = {
    "shift": HandPlace((0.34, 0.5, 0.1), "floor", (0.7, -0.4, -0.8)),
    "rest": HandPlace((-0.02, 0.13, -0.1), "knee"),
}
"""Where a hand is that leaves the wheel: on a gear stick, or on the thigh."""


class _Driver:
    """A driver who moves: the postures of a body on a seat that stays."""

    def __init__(self, rng: random.Random, way: Way) -> None:
        self.rng, self.way = rng, way
        self.form = way.car or rng.choices(list(_CARS), (5, 3, 2))[0]
        self.manner = rng.choice(list(_RATES)) if way.manner is None else way.manner
        car = _CARS[self.form]
        seat, lean, feet, radius, tilt = (
            rng.uniform(*car[name]) for name in ("seat", "lean", "feet", "radius", "tilt")
        )
        back, bend = -rng.uniform(0.3, 0.36), rng.uniform(2, 10)
        trunk = math.radians(lean + 0.5 * bend)
        up, ahead = rng.uniform(-0.22, -0.12), rng.uniform(0.37, 0.42)
        over = seat + (_TRUNK + up) * math.cos(trunk) - ahead * math.sin(trunk)
        before = back + (_TRUNK + up) * math.sin(trunk) + ahead * math.cos(trunk)
        self.wheel = _Wheel(max(radius, 0.155), over, before, tilt, rng.uniform(10.0, 28.0))
        self.feet = feet
        self.pedals = {
            LEFT: FootPlace((0.13, _HEEL, feet), _TOES),
            RIGHT: FootPlace((0.08, _HEEL, feet + 0.03), _TOES),
        }
        seated = Posture((0.0, seat, back), (lean, 0, 0), (bend, 0, 0), neck=(-0.5 * lean - 4, 0, 0), feet=self.pedals)
        self.seated = replace(seated, knees=dict.fromkeys(SIDES, (rng.uniform(0.1, 0.3), 1.0, 0.6)))
        self.turned, self.look, self.free = 0.0, 0.0, False
        self.done = Sequel([rng.uniform(0.1, 0.4)], [self.at()])

    def at(self) -> Posture:
        """The driver leans a little out of the turn and looks into it."""
        pressed = replace(self.pedals[RIGHT], at=(0.08, _HEEL, self.feet + 0.03 + self.rng.choice((0.0, 0.02))))
        spine = (self.seated.spine[0], -0.05 * self.turned, _FOLLOWS * self.look)
        neck = (self.seated.neck[0], 0.05 * self.turned, self.look)
        hands = {side: self.wheel.hand(side, self.turned) for side in SIDES}
        if self.free:
            hands[self.way.side] = _FREE[self.way.lets_go]
        return replace(self.seated, spine=spine, neck=neck, hands=hands, feet={**self.pedals, RIGHT: pressed})

    def steer(self, goal: float, look: float | None = None) -> None:
        """Turn the wheel to `goal`, degrees to the right."""
        count = max(1, math.ceil(abs(goal - self.turned) / _STEP))
        seconds = abs(goal - self.turned) / self.rng.uniform(*_RATES[self.manner]) + 0.15
        begin, self.look = self.turned, -0.25 * goal if look is None else look
        for k in range(count):
            self.turned = begin + (goal - begin) * (k + 1) / count
            self.done.then(seconds / count, self.at())
        self.turned = goal + self.rng.uniform(-4, 4)
        self.done.then(self.rng.uniform(0.15, 0.6), self.at())
        self.turned = goal

    def take_off(self, hold: float) -> None:
        """Take a hand off the wheel for so many seconds, and put it back."""
        self.look, self.free = 0.0, True
        self.done.then(self.rng.uniform(0.45, 0.6), self.at(), hold)
        self.free = False
        self.done.then(self.rng.uniform(0.45, 0.6), self.at())

    def goal(self, number: int) -> float:
        """Return the degrees to the right by which the wheel is turned next; every other time back to the middle, if
        sides are named."""
        most = {"calm": 30.0, "": 55.0, "hard": 72.0}[self.manner]
        far = self.rng.uniform(0.8, 1.0) * max(most, 65.0) if self.way.sharp else self.rng.uniform(0.5, 1.0) * most
        sides = self.way.turns
        if sides:
            back = len(sides) == 1 and number % 2 == 1
            return 0.0 if back else -SIGN[sides[number // (2 if len(sides) == 1 else 1) % len(sides)]] * max(far, 30.0)
        if abs(self.turned) < 20:
            return self.rng.choice((-1.0, 1.0)) * far
        return self.rng.choice((0.0, -0.8 * self.turned))


def drive(rng: random.Random, way: Way | None = None) -> Gesture:
    """A driver on a seat that does not turn, with the hands on a wheel that stays where it is.

    Args:
        rng: decides everything that is not given.
        way: how the driver drives.
    """
    way = way or Way()
    driver = _Driver(rng, way)
    end = rng.uniform(2.6, 7.8) if way.seconds is None else way.seconds - 0.5
    looks = rng.random() < 0.4 if way.looks is None else way.looks
    number = 0
    while number < max(1, len(way.turns)) or driver.done.times[-1] < end:
        if way.lets_go and number == 1:
            driver.take_off(0.25 * end if way.lets_go == "rest" else rng.uniform(0.3, 0.6))
        driver.steer(driver.goal(number), rng.uniform(-45, 45) if looks and rng.random() < 0.5 else None)
        number += 1
    form, manner = driver.form, driver.manner
    kinds = ["drive", form, f"drive-{manner}" if manner else "", "drive-look" if looks else ""]
    untrue = "car" if form == "drive-truck" else "truck|bus"
    return replace(driver.done.gesture(rng, kinds), untrue=untrue)
