"""Waves, raised arms, guiding arms and claps."""

from __future__ import annotations

import random

import numpy as np

from marey.drawing.gesture import BOTH, SIDES, Gesture
from marey.drawing.parts import GesturePace, arms_of, drawn_arm, respond
from marey.posing.limbs import FPS
from marey.posing.standing import ARMS, StandingBody, envelope, swings, swung

_WAVES = {
    "wave-high": {"upper": ((20, 100), (5, 60)), "fore": ((30, 90), (72, 88)), "swing": (14, 34)},
    "wave-low": {"upper": ((5, 60), (-72, -40)), "fore": ((10, 50), (35, 70)), "swing": (17, 34)},
    "wave-whole": {"upper": ((40, 95), (50, 75)), "fore": ((40, 90), (70, 85)), "swing": (10, 18)},
}
"""Azimuths and elevations of upper arm and forearm, and the swing of the forearm to each side, degrees."""

_WAVES_HZ = (1.7, 2.2)
"""Swings to and fro a second of a wave that fills a time."""
_SWINGS_FROM = 0.7
"""Share of the rise of the hand from which on it swings."""


def wave(rng: random.Random) -> Gesture:
    form = rng.choices(list(_WAVES), (5, 3, 2))[0]
    tempo = rng.choice(["slow", "", "fast"])
    rate = {"slow": rng.uniform(1.2, 1.6), "": rng.uniform(1.6, 2.4), "fast": rng.uniform(2.4, 3.2)}[tempo]
    length = rng.choice(["brief", "", "", "long"])
    hold = {"brief": (1.3 / rate, 1.7 / rate), "": (2.0 / rate, 3.4), "long": (4.2, 6.5)}[length]
    pace = GesturePace.draw(rng, (0.35, 0.9), hold)
    side = rng.choices([*SIDES, BOTH], (4, 4, 1))[0]
    form = "wave-high" if side == BOTH and form == "wave-low" else form  # who waves both is to be seen from afar
    arms = {one: drawn_arm(rng, _WAVES[form]) for one in arms_of(side)}
    whole = rng.uniform(0.5, 0.9) if form == "wave-whole" else rng.uniform(0, 0.15)
    twist, sway = rng.uniform(-2, 8), rng.uniform(0, 4)
    inward = rng.choice((-1.0, 1.0))

    def change(body: StandingBody) -> None:
        way = pace.way(body)
        swing = inward * swings(way, rate)
        respond(body, way, side, twist, sway)
        for one, arm in arms.items():
            upper = swung(arm.upper, whole * arm.swing * swing)
            body.move_arm(one, way, upper, swung(arm.fore, arm.swing * (1 + whole) * swing), arm.lag)

    if side == BOTH:
        return Gesture(pace.total(rng), ("wave-both",), change, side)
    kinds = ["wave", "wave-low" if form == "wave-low" else "wave-high"]
    kinds += [f"wave-{word}" for word in (tempo, length) if word]
    return Gesture(pace.total(rng), tuple(kinds), change, side)


_RAISES = {
    "raise-up": {"upper": ((10, 90), (64, 86)), "fore": ((0, 90), (74, 89))},
    "raise-side": {"upper": ((76, 102), (14, 50)), "fore": ((70, 100), (22, 62))},
    "raise-ahead": {"upper": ((-5, 24), (14, 50)), "fore": ((-8, 22), (20, 60))},
    "raise-bent": {"upper": ((30, 95), (-5, 35)), "fore": ((20, 90), (72, 89))},
}


def raise_arm(rng: random.Random) -> Gesture:
    side = rng.choices([*SIDES, BOTH], (4, 4, 2))[0]
    form = "raise-up" if side == BOTH else rng.choice(list(_RAISES))
    length = rng.choice(["quick", "", "", "long"])
    rise = {"quick": (0.3, 0.45), "": (0.45, 1.1), "long": (0.5, 1.4)}[length]
    hold = {"quick": (0.3, 0.5), "": (0.5, 2.0), "long": (2.2, 5.5)}[length]
    pace = GesturePace.draw(rng, rise, hold)
    arms = {one: drawn_arm(rng, _RAISES[form]) for one in arms_of(side)}
    twist, sway = rng.uniform(-2, 6), rng.uniform(0, 5)

    def change(body: StandingBody) -> None:
        way = pace.way(body)
        respond(body, way, side, twist, sway)
        for one, arm in arms.items():
            body.move_arm(one, way, arm.upper, arm.fore, arm.lag)

    if side == BOTH:
        return Gesture(pace.total(rng), ("raise-both",), change, side)
    kinds = ("raise", form, *([f"raise-{length}"] if length else []))
    return Gesture(pace.total(rng), kinds, change, side)


_GUIDES = {
    "guide-side": {"upper": ((62, 98), (-42, -12)), "fore": ((60, 95), (-14, 18))},
    "guide-ahead": {"upper": ((0, 32), (-42, -12)), "fore": ((0, 32), (-14, 18))},
}


def guide(rng: random.Random) -> Gesture:
    form, side = rng.choice(list(_GUIDES)), rng.choice(SIDES)
    pace = GesturePace.draw(rng, (0.45, 1.1), (0.7, 2.5))
    arm = drawn_arm(rng, _GUIDES[form])
    twist, stoop = rng.uniform(0, 14), rng.uniform(0, 14)

    def change(body: StandingBody) -> None:
        way = pace.way(body)
        body.lean(stoop * way, "left")
        respond(body, way, side, twist, 0.0)
        body.move_arm(side, way, arm.upper, arm.fore, arm.lag)

    return Gesture(pace.total(rng), (form,), change, side)


def clap(rng: random.Random) -> Gesture:
    high = rng.random() < 0.35
    tempo = rng.choice(["slow", "", "", "fast"])
    rate = {"slow": rng.uniform(0.8, 1.5), "": rng.uniform(1.7, 2.4), "fast": rng.uniform(2.6, 3.6)}[tempo]
    pace = GesturePace.draw(rng, (0.4, 0.9), (3.6 / rate, max(5.0, 4.0 / rate)))
    above = rng.uniform(0.02, 0.46) if high else rng.uniform(-0.34, -0.06)
    ahead = rng.uniform(0.18, 0.3) if high else rng.uniform(0.25, 0.36)
    apart = rng.uniform(0.16, 0.34) if tempo == "slow" else rng.uniform(0.09, 0.22)
    aside, beat, gaze = rng.uniform(-0.05, 0.05), rng.uniform(0.0, 0.035), rng.uniform(-10, 8)

    def change(body: StandingBody) -> None:
        way = pace.way(body)
        swing = swings(way, rate)
        gap = 0.05 + apart * (0.5 - 0.5 * swing)
        body.lean((gaze if not high else -abs(gaze)) * way, "left", (12,))
        body.shift(-0.4 * beat * way * (0.5 + 0.5 * swing))
        middle = body.joints[:, [ARMS[side][1] for side in SIDES]].mean(1)
        for side in SIDES:
            seen = body.from_shoulder(side, middle)
            out = gap + (aside if side == SIDES[0] else -aside)
            target = np.stack([seen[:, 0] + out, seen[:, 1] + above + beat * swing, seen[:, 2] + ahead], axis=-1)
            body.move_arm(side, way, *body.reach(side, target), 0.03)

    kinds = ("clap-high" if high else "clap", *([f"clap-{tempo}"] if tempo else []))
    return Gesture(pace.total(rng), kinds, change, BOTH)


_APART, _TOGETHER = (0.2, 0.28), 0.05
"""Metres of each hand from the middle of the body between claps, and when they meet."""
_CLAPS_HZ = (1.8, 2.3)


def clap_times(rng: random.Random, count: int, *, high: bool = False) -> Gesture:
    """Hands that go up before the chest or over the head, meet so many times, and come down.

    Args:
        rng: decides the rest.
        count: of the claps.
        high: over the head.
    """
    rate = rng.uniform(*_CLAPS_HZ)
    start, rise, fall = rng.uniform(0.2, 0.5), rng.uniform(0.45, 0.6), rng.uniform(0.5, 0.7)
    above = rng.uniform(0.42, 0.48) if high else rng.uniform(-0.2, -0.08)
    ahead, apart = rng.uniform(0.1, 0.16) if high else rng.uniform(0.28, 0.34), rng.uniform(*_APART)
    seconds = start + rise + count / rate + fall + rng.uniform(0.4, 0.7)

    def change(body: StandingBody) -> None:
        way = envelope(len(body.joints), start, rise, count / rate, fall)
        phase = np.clip((np.arange(len(way)) / FPS - start - rise) * rate, 0.0, count)
        gap = _TOGETHER + (apart - _TOGETHER) * (0.5 + 0.5 * np.cos(2 * np.pi * phase))
        for side in SIDES:
            point = np.stack([gap, np.full(len(gap), above), np.full(len(gap), ahead)], axis=-1)
            body.hold(side, way, point, lag=0.0)

    return Gesture(seconds, ("clap-times",), change, BOTH, count)


def wave_for(rng: random.Random, side: str = "", count: int | None = None, *, seconds: float) -> Gesture:
    """A hand that goes up, waves to and fro about its elbow for all of a time, and comes down.

    Args:
        rng: decides the rest.
        side: of the hand; empty = either.
        count: of the swings to and fro; None = as many as fill the time.
        seconds: to be filled, from before the hand goes up.
    """
    side = side or rng.choice(SIDES)
    start, rise, fall, rests = rng.uniform(0.05, 0.1), rng.uniform(0.65, 0.75), rng.uniform(0.55, 0.65), 0.1
    hold = max(seconds - start - rise - fall - rests, 0.8)
    rate = count / hold if count else rng.uniform(*_WAVES_HZ)
    arm, degrees = drawn_arm(rng, _WAVES["wave-high"]), rng.uniform(22, 32)
    twist, sway, inward = rng.uniform(0, 5), rng.uniform(0, 3), rng.choice((-1.0, 1.0))

    def change(body: StandingBody) -> None:
        way = envelope(len(body.joints), start, rise, hold, fall)
        phase = np.clip(np.arange(len(way)) / FPS - start - _SWINGS_FROM * rise, 0.0, None)
        swing = inward * np.sin(2 * np.pi * rate * phase) * way**2
        respond(body, way, side, twist, sway)
        body.move_arm(side, way, arm.upper, swung(arm.fore, degrees * swing), 0.0)

    return Gesture(start + rise + hold + fall + rests, ("wave", "wave-high"), change, side, count or 1)


_OVERHEAD_HZ, _WILDLY_HZ = (0.95, 1.3), (1.4, 1.8)
_OUT, _IN = 0.34, -0.06
"""Metres of each hand outward of its shoulder, between which both go to and fro over the head."""


def wave_overhead(
    rng: random.Random, count: int | None = None, *, seconds: float | None = None, wild: bool = False
) -> Gesture:
    """Both arms that go up and swing to and fro over the head, and come down.

    Args:
        rng: decides the rest.
        count: of the swings to and fro; None = as many as fill the time.
        seconds: to be filled; None = three to four.
        wild: fast, and with a body that goes up and down.
    """
    rate = rng.uniform(*(_WILDLY_HZ if wild else _OVERHEAD_HZ))
    start, rise, fall = rng.uniform(0.15, 0.4), rng.uniform(0.5, 0.65), rng.uniform(0.55, 0.75)
    least = start + rise + fall + 0.5
    hold = count / rate if count else max((seconds or rng.uniform(4.2, 5.2)) - least, 1.0)
    crosses, bounce = rng.random() < 0.6, (0.02 if wild else 0.006)

    def change(body: StandingBody) -> None:
        way = envelope(len(body.joints), start, rise, hold, fall)
        phase = np.clip((np.arange(len(way)) / FPS - start - 0.6 * rise) * rate, 0.0, None)
        body.shift(-bounce * way * (1.0 + np.cos(4 * np.pi * phase)))
        for side in SIDES:
            swing = np.cos(2 * np.pi * phase + (np.pi if not crosses and side == SIDES[0] else 0.0))
            out = 0.5 * (_OUT + _IN) + 0.5 * (_OUT - _IN) * swing
            up = 0.47 - 0.5 * np.maximum(out - 0.08, 0.0) ** 2
            point = np.stack([out, up, np.full(len(way), 0.07)], axis=-1)
            body.move_arm(side, way, *body.reach(side, point), 0.0)

    return Gesture(least + hold, ("wave-overhead",), change, BOTH, count or 1)
