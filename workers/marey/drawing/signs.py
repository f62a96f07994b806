"""Large arm signs, as of a traffic officer, a referee or a marshal."""

from __future__ import annotations

import random
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from marey.drawing.gesture import BOTH, SIDES, Gesture
from marey.motion.rotations import normalize
from marey.posing.limbs import FPS
from marey.posing.standing import StandingBody, direction, envelope, stations, swung

Array = NDArray[np.floating]

_DOWN, _ACROSS = "down", "across"
_PLACES = {
    "side": (((80, 98), (-6, 12)), ((78, 98), (-6, 12))),
    "ahead": (((-4, 20), (-4, 14)), ((-6, 16), (0, 24))),
    "up": (((20, 90), (66, 84)), ((20, 90), (76, 88))),
    "stop": (((30, 70), (-4, 20)), ((20, 60), (60, 84))),
    "slant": (((50, 90), (28, 48)), ((50, 90), (30, 50))),
    _ACROSS: (((-30, -12), (-10, 8)), ((-62, -40), (-6, 10))),
    _DOWN: (((30, 80), (-86, -74)), ((20, 50), (-84, -72))),
}
"""Azimuths and elevations of upper arm and forearm, degrees; see `direction`."""
_ALIKE = {_ACROSS: "slant"}
"""Signs of both arms at once instead of those in which they would meet across the trunk."""
_SWUNG = ("side", "stop", "up")


def signal(rng: random.Random) -> Gesture:
    form = rng.choices(["signal-mixed", "signal-both", "signal-one"], (5, 3, 2))[0]
    side = rng.choice(SIDES) if form == "signal-one" else BOTH
    signs = rng.randint(3, 6)
    brisk = rng.random() < 0.5
    times = _times(rng, signs, brisk=brisk)
    count = (len(times) - 3) // 2
    names = _signs(rng, form, side, count)
    paths = {one: [_bones(rng, name) for name in row] for one, row in names.items()}
    swing, rate = rng.choice([0.0, rng.uniform(10, 24)]), rng.uniform(1.2, 2.2)
    looks = [(rng.uniform(-35, 35), rng.uniform(-6, 6)) for _ in range(count)]
    acting = SIDES if side == BOTH else (side,)

    def change(body: StandingBody) -> None:
        frames = len(body.joints)
        yaw, twist = stations(frames, times, _held([(0.0, 0.0), *looks, (0.0, 0.0)])).T
        body.lean(yaw, "up", (12,))
        body.lean(twist, "up", (6, 9))
        last = times[-1] - times[-2]
        way = envelope(frames, times[1], times[2] - times[1], times[-2] - times[2], last)
        wag = swing * np.sin(2 * np.pi * rate * np.arange(frames) / FPS)
        for one in acting:
            bones = np.array([paths[one][0], *paths[one], paths[one][-1]])
            upper, fore = (_between(stations(frames, times, _held(list(bones[:, k])))) for k in (0, 1))
            wags = [[float(name in _SWUNG)] for name in (_DOWN, *names[one], _DOWN)]
            fore = swung(fore, wag * stations(frames, times, _held(wags))[:, 0])
            body.move_arm(one, way, upper, fore, 0.05)

    kinds = ["signal", form, "signal-brisk" if brisk else "signal-calm"]
    return Gesture(times[-1] + rng.uniform(0.3, 0.8), tuple(kinds), change, side)


def _times(rng: random.Random, signs: int, *, brisk: bool) -> list[float]:
    """Seconds at which the arms begin to move and stop: up to each sign, of which long ones are fewer, and down."""
    moves, holds = ((0.38, 0.5), (0.3, 0.8)) if brisk else ((0.45, 0.75), (0.5, 1.3))
    times, begin = [0.0], rng.uniform(0.1, 0.6)
    for _ in range(signs):
        times += [begin, begin + rng.uniform(*moves)]
        begin = times[-1] + rng.uniform(*holds)
        if begin > 7.4 and len(times) >= 7:
            break
    return [*times, begin, begin + rng.uniform(0.5, 0.8)]


def _signs(rng: random.Random, form: str, side: str, count: int) -> dict[str, list[str]]:
    """Draw the names of the signs of each arm."""
    names = {one: _sequence(rng, count) if side in (one, BOTH) else [_DOWN] * count for one in SIDES}
    if form == "signal-both":
        alike = [_ALIKE.get(name, name) for name in names[SIDES[0]]]
        return dict.fromkeys(SIDES, alike)
    if form == "signal-mixed":  # one arm rests now and then, never both
        for k in range(count):
            crossed = all(row[k] == _ACROSS for row in names.values())
            if crossed or rng.random() < 0.5:
                names[rng.choice(SIDES)][k] = _DOWN
    return names


def _between(vectors: Array) -> Array:
    """Directions (T, 3) of mean directions (T, 3), which are short between far ones; these lead past the front."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return normalize(vectors + 1.3 * (1 - length) * direction(35.0, -5.0))


def _sequence(rng: random.Random, count: int) -> list[str]:
    """Places of one arm, each other than the one before."""
    found: list[str] = []
    while len(found) < count:
        name = rng.choice(list(_PLACES)[:-1])
        if not found or name != found[-1]:
            found.append(name)
    return found


def _bones(rng: random.Random, name: str) -> tuple[Array, Array]:
    upper, fore = _PLACES[name]
    return direction(*(rng.uniform(*one) for one in upper)), direction(*(rng.uniform(*one) for one in fore))


def _held(values: Sequence) -> Array:
    """Each value twice, so that it is held between two moves; the last once."""
    return np.repeat(np.asarray(values, np.float64), 2, axis=0)[:-1]
