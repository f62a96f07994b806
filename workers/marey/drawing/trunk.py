"""Bows, nods and shivers."""

from __future__ import annotations

import random
from dataclasses import replace

import numpy as np

from marey.drawing.gesture import BOTH, SIDES, Gesture
from marey.drawing.parts import GesturePace
from marey.posing.standing import StandingBody, envelope, swings, tremble

_SLIGHT, _DEEP, _DEEPEST = 36.0, 66.0, 100.0
"""Degrees of a bow from the hips to the neck; the trunk as a whole tilts by three quarters of this."""
_BOWS_DEGREES_S = 85.0
"""Degrees a second by which a body bows at most."""
_DEEPLY, _DEEP_HOLD_S = 1.4, 0.7
"""How many times as long as another a deep bow takes to go down, and seconds for which it is held at least."""


def bow(rng: random.Random, *, times: int | None = None) -> Gesture:
    degrees = rng.choice([rng.uniform(30, _SLIGHT), rng.uniform(_SLIGHT, _DEEP), rng.uniform(80, _DEEPEST)])
    times = times or rng.choices((1, 2, 3), (8, 1, 1))[0]
    tempo = rng.choice(["quick", "", "", "slow"])
    rise = {"quick": (0.35, 0.55), "": (0.6, 1.1), "slow": (1.0, 1.6)}[tempo]
    hold = {"quick": (0.05, 0.2), "": (0.15, 0.9), "slow": (1.0, 2.0)}[tempo]
    if degrees > _DEEP and tempo != "quick":
        rise, hold = (rise[0] * _DEEPLY, rise[1] * _DEEPLY), (max(hold[0], _DEEP_HOLD_S), hold[1] + _DEEP_HOLD_S)
    least = degrees / _BOWS_DEGREES_S
    paces = [GesturePace.draw(rng, (max(rise[0], least), max(rise[1], least)), hold)]
    for _ in range(times - 1):
        one = replace(paces[0], start=paces[-1].seconds + rng.uniform(0.0, 0.3))
        paces.append(one)
    hand = rng.choice(SIDES) if rng.random() < 0.25 else ""
    arms_hang, head = rng.uniform(0.1, 0.9) if not hand else 0.0, rng.uniform(-0.15, 0.3)
    belly = rng.uniform(0.1, 0.28), rng.uniform(0.17, 0.22)

    def change(body: StandingBody) -> None:
        ways = [pace.way(body) for pace in paces]
        if hand:
            first, last = paces[0].start, paces[-1].seconds
            rises = max(0.5, 0.8 * paces[0].rise)
            held = envelope(len(body.joints), max(first - 0.5, 0.0), rises, last - first, 0.6)
            pelvis = body.from_shoulder(hand, body.joints[:, 0])
            target = pelvis + np.array([0.02, belly[0], belly[1]])
            body.move_arm(hand, held, *body.reach(hand, target), 0.0)
        body.bow(degrees * np.sum(ways, axis=0), arms_hang=arms_hang, head=head)

    depth = "bow-deep" if degrees > _DEEP else "bow-slight" if degrees < _SLIGHT else ""
    kinds = ["bow", depth, f"bow-{tempo}" if tempo else "", "bow-hand" if hand else ""]
    if times > 1:
        kinds = ["bow-repeated"]
    return Gesture(paces[-1].total(rng), tuple(filter(None, kinds)), change, hand, times)


def nod(rng: random.Random) -> Gesture:
    tempo = rng.choice(["slow", "", "quick"])
    rate = {"slow": rng.uniform(0.7, 1.0), "": rng.uniform(1.0, 1.7), "quick": rng.uniform(1.9, 2.6)}[tempo]
    degrees = rng.uniform(8, 12) if tempo == "quick" else rng.uniform(9, 18)
    pace = GesturePace.draw(rng, (0.2, 0.4), (2.2 / rate, 4.5 / rate))
    neck = rng.uniform(0.1, 0.3)

    def change(body: StandingBody) -> None:
        down = degrees * (0.5 - 0.5 * np.cos(np.pi * pace.way(body))) * (0.6 + swings(pace.way(body), rate))
        body.lean(neck * down, "left", (9,))
        body.lean((1 - neck) * down, "left", (12,))

    return Gesture(pace.total(rng), ("nod", *([f"nod-{tempo}"] if tempo else [])), change)


_HUGS = {
    "shiver-crossed": {"out": (-0.12, -0.05), "up": (-0.25, -0.15), "ahead": (0.15, 0.2)},
    "shiver-fists": {"out": (0.02, 0.08), "up": (-0.16, -0.06), "ahead": (0.15, 0.22)},
    "shiver-low": {"out": (-0.06, 0.04), "up": (-0.36, -0.27), "ahead": (0.18, 0.24)},
}
"""Places of the hands before the trunk; see `StandingBody.hold`."""


def shiver(rng: random.Random) -> Gesture:
    form, seconds = rng.choice(list(_HUGS)), rng.uniform(2.5, 8.0)
    pace = GesturePace.lasting(seconds)
    if rng.random() < 0.3:
        pace = GesturePace(rng.uniform(0.05, 0.3), rng.uniform(0.35, 0.6), seconds, 1.0)
    out, up, ahead = (rng.uniform(*_HUGS[form][name]) for name in ("out", "up", "ahead"))
    uneven, bent, lift = rng.uniform(-0.03, 0.03), rng.uniform(4, 14), rng.uniform(8, 20)
    rate, strength = rng.uniform(4.3, 5.2), rng.uniform(0.013, 0.021)
    phases = [rng.uniform(0, 6.28) for _ in range(9)]

    def change(body: StandingBody) -> None:
        way = pace.way(body)
        shake = [way * tremble(len(way), rate, phase) for phase in phases]
        body.shift(0.2 * strength * shake[0] - 0.02 * way, left=0.3 * strength * shake[1])
        body.lean(bent * way + 40 * strength * shake[2], "left")
        body.lean(60 * strength * shake[3], "up")
        body.lean(0.8 * bent * way, "left", (12,))
        body.shrug(lift * way + 100 * strength * shake[4])
        for k, one in enumerate(SIDES):
            point = np.array([out, up + (uneven, -uneven)[k], ahead + (0.015, -0.015)[k]])
            moved = np.stack([0.5 * shake[5 + 2 * k], shake[6 + 2 * k], 0.4 * shake[5]], axis=-1)
            body.hold(one, way, point + strength * moved)

    return Gesture(seconds, ("shiver", form), change, BOTH)
