"""Hands that reach forward and hands that talk."""

from __future__ import annotations

import random

import numpy as np
from numpy.typing import NDArray

from marey.drawing.gesture import BOTH, SIDES, Gesture
from marey.drawing.parts import GesturePace, arms_of, respond
from marey.posing.standing import StandingBody, direction, stations, swings

Array = NDArray[np.floating]

_ARM = 0.52
"""Metres from shoulder to wrist."""
_REACHES = {
    "reach-press": {"up": (-24, -3), "out": (-24, 10), "far": (0.93, 0.98), "hold": (0.25, 1.0)},
    "reach-door": {"up": (-40, -27), "out": (-12, 18), "far": (0.94, 0.98), "hold": (0.6, 1.7)},
    "reach-take": {"up": (-36, -8), "out": (-26, 14), "far": (0.93, 0.98), "hold": (0.3, 1.1)},
    "reach-shake": {"up": (-32, -20), "out": (-26, -8), "far": (0.92, 0.97), "hold": (1.0, 2.2)},
}
"""Elevation and azimuth of the arm in degrees, its extension, and the seconds for which the hand stays."""


def reach_forward(rng: random.Random) -> Gesture:
    form, side = rng.choice(list(_REACHES)), rng.choice(SIDES)
    limits = _REACHES[form]
    up, out, far = (rng.uniform(*limits[name]) for name in ("up", "out", "far"))
    tempo = rng.choice(["quick", "", "", "slow"])
    rise = {"quick": (0.3, 0.45), "": (0.5, 0.85), "slow": (0.95, 1.4)}[tempo]
    pace = GesturePace.draw(rng, rise, limits["hold"])
    shakes = rng.uniform(1.8, 2.8), rng.uniform(0.02, 0.035) if form == "reach-shake" else 0.0
    twist, stoop, head = rng.uniform(12, 22), rng.uniform(4, 9) - 0.2 * up, rng.uniform(0, 8)

    def change(body: StandingBody) -> None:
        way = pace.way(body)
        body.lean(stoop * way, "left")
        respond(body, way, side, twist, 0.0)
        body.lean(head * way, "left", (12,))
        target = np.tile(_ARM * far * direction(out, up), (len(way), 1))
        target[:, 1] += shakes[1] * swings(way, shakes[0])
        body.move_arm(side, way, *body.reach(side, target), 0.05)

    kinds = ("reach", form, *([f"reach-{tempo}"] if tempo else []))
    return Gesture(pace.total(rng), kinds, change, side)


_TALKS = {
    "calm": {"beat": (0.36, 0.55), "size": (0.075, 0.07, 0.06)},
    "": {"beat": (0.28, 0.46), "size": (0.09, 0.08, 0.07)},
    "lively": {"beat": (0.2, 0.34), "size": (0.11, 0.1, 0.08)},
}
"""Seconds from one place of a hand to the next, and how far from its middle such places lie, metres."""
_PAUSES = 0.18  # share of the beats that are followed by a pause


def talk(rng: random.Random) -> Gesture:
    mood, form = rng.choice(list(_TALKS)), rng.choices(["together", "apart", "one"], (3, 3, 4))[0]
    seconds = rng.uniform(3.0, 9.0)
    times = _beats(rng, _TALKS[mood]["beat"], seconds)
    side = rng.choice(SIDES) if form == "one" else BOTH
    paths = {one: _places(rng, len(times), _TALKS[mood]["size"]) for one in arms_of(side)}
    if form == "together":
        first = paths[SIDES[0]]
        paths = {one: first + np.array([[rng.gauss(0, 0.012) for _ in range(3)] for _ in first]) for one in SIDES}
    pace = GesturePace.lasting(seconds)
    if rng.random() < 0.5:
        pace = GesturePace(rng.uniform(0.05, 0.4), rng.uniform(0.35, 0.6), seconds - 1.8, rng.uniform(0.5, 0.8))
    looks = _beats(rng, (0.5, 1.4), seconds)
    head = [(rng.uniform(-18, 18), rng.uniform(-5, 7), rng.uniform(-3, 3)) for _ in looks]

    def change(body: StandingBody) -> None:
        way = pace.way(body)
        yaw, nod, twist = stations(len(way), looks, head).T
        body.lean(yaw, "up", (12,))
        body.lean(nod, "left", (12,))
        body.lean(twist * way, "up", (6, 9))
        for one, path in paths.items():
            body.hold(one, way, stations(len(way), times, path), lag=0.05)

    kinds = ("talk", "talk-one" if form == "one" else "talk-both", *([f"talk-{mood}"] if mood else []))
    return Gesture(seconds, kinds, change, side)


def _beats(rng: random.Random, beat: tuple[float, float], seconds: float) -> list[float]:
    """Times from 0 on to the end, seconds."""
    times = [0.0]
    while times[-1] < seconds:
        times.append(times[-1] + rng.uniform(*beat))
    return times


def _places(rng: random.Random, count: int, size: tuple[float, float, float]) -> Array:
    """Places of a hand (count, 3) around a middle of its own between waist and shoulders; see `StandingBody.hold`."""
    middle = np.array([rng.uniform(0.1, 0.2), rng.uniform(-0.26, -0.18), rng.uniform(0.24, 0.32)])
    found = [middle]
    while len(found) < count:
        if rng.random() < _PAUSES:
            found.append(found[-1])
            continue
        place = middle + np.array([rng.uniform(-1, 1) * one for one in size])
        if np.linalg.norm(place - found[-1]) > 0.8 * size[0]:
            found.append(place)
    return np.array(found)
