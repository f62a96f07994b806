"""Bodies that laugh."""

from __future__ import annotations

import random

import numpy as np

from marey.drawing.gesture import BOTH, SIDES, Gesture
from marey.drawing.stances import before, settle
from marey.posing.limbs import FPS
from marey.posing.standing import LEGS, StandingBody, eased, envelope, tremble

_HEAD, _NECK = 15, (12,)
_LAUGHS = {
    "laugh-belly": {"bent": (14, 26), "rock": (12, 20)},
    "laugh-mouth": {"bent": (12, 22), "rock": (11, 17)},
    "laugh-knees": {"bent": (50, 66), "rock": (12, 20)},
    "laugh-back": {"bent": (-6, 6), "rock": (13, 21)},
    "laugh-loose": {"bent": (8, 20), "rock": (12, 22)},
    "laugh-point": {"bent": (8, 20), "rock": (12, 18)},
}
"""Degrees by which the trunk is bent in the middle of a laugh, and by which it rocks to each side of that."""
_BOTH_HANDS = ("laugh-belly", "laugh-knees")


def laugh(rng: random.Random) -> Gesture:
    form = rng.choices(list(_LAUGHS), (4, 2, 3, 3, 3, 1))[0]
    bent, rock = (rng.uniform(*_LAUGHS[form][name]) for name in ("bent", "rock"))
    side = rng.choice(SIDES) if form in ("laugh-mouth", "laugh-point") else BOTH
    if form == "laugh-belly" and rng.random() < 0.4:
        side = rng.choice(SIDES)
    start, rise, fall = rng.uniform(0.1, 0.7), rng.uniform(0.35, 0.7), rng.uniform(0.6, 1.1)
    rate, rounds = rng.uniform(0.55, 1.05), rng.uniform(2.6, 5.0)
    seconds = min(start + rise + rounds / rate + fall, 8.8)
    hold = seconds - start - rise - fall
    shakes, strength = rng.uniform(3.6, 5.0), rng.uniform(0.7, 1.4)
    uneven = [rng.uniform(0, 6.28) for _ in range(4)]
    shrugged, gaze = rng.uniform(3, 8), rng.uniform(-0.25, 0.25)
    sink = rng.uniform(0.05, 0.1) if form == "laugh-knees" else rng.uniform(0.0, 0.02)
    twist, sway = rng.uniform(0, 7), rng.uniform(0, 0.02)
    low, aside = rng.uniform(-0.05, 0.06), rng.uniform(0.02, 0.09)
    point = np.array([rng.uniform(-0.05, 0.25), rng.uniform(-0.12, 0.04), 0.48])
    slower = rng.uniform(0.0, 0.25)

    def change(body: StandingBody) -> None:
        frames = len(body.joints)
        t = np.arange(frames) / FPS
        way = envelope(frames, start, rise, hold, fall)
        phase = 2 * np.pi * rate * (t - start) * (1 - slower * (t / seconds)) + 0.4 * np.sin(1.3 * t + uneven[0])
        tired = 1 - 0.25 * eased((t - start - 0.6 * hold) / (0.5 * hold))
        shake = way * tremble(frames, shakes, uneven[1]) * strength
        degrees = way * (bent - rock * tired * np.sin(phase + 0.5)) + 1.6 * shake
        body.shift(-sink * way + 0.005 * shake, left=sway * way * np.sin(0.5 * phase + uneven[2]))
        body.bow(degrees, arms_hang=0.6, head=gaze)
        settle(body)
        body.lean(twist * way * np.sin(0.5 * phase + uneven[3]), "up")
        body.lean(3.0 * way * np.sin(phase + 1.2) + 2.0 * shake, "left", _NECK)
        body.shrug(shrugged * way * 0.6 + 4.0 * shake)
        for one in SIDES:
            goal = _goal(body, form, one, low, aside)
            if side not in (one, BOTH) or (goal is None and form != "laugh-point"):
                continue
            later = envelope(frames, start + 0.1, rise + 0.1, hold - 0.1, fall)
            if goal is None:
                body.hold(one, later, point + 0.012 * shake[:, None], lag=0.04)
            else:
                body.move_arm(one, later, *body.reach(one, body.from_shoulder(one, goal), (0.9, -0.8, -0.3)), 0.04)

    kinds = ("laugh", form, "laugh-hearty" if rock > 16 or form == "laugh-knees" else "laugh-light")
    return Gesture(seconds + rng.uniform(0.25, 0.9), kinds, change, side)


def _goal(body: StandingBody, form: str, side: str, low: float, aside: float) -> np.ndarray | None:
    """Where a hand is in the world (T, 3), or None for arms that hang."""
    frames = len(body.joints)
    out = body.world(np.tile([1.0, 0.0, 0.0], (frames, 1)), side)
    if form == "laugh-belly":
        return before(body, 3, 0.17) + aside * out + [0.0, low, 0.0]
    if form == "laugh-mouth":
        ahead = body.world(np.tile([0.03, -0.05, 0.125], (frames, 1)), side)
        return body.joints[:, _HEAD] + ahead
    if form == "laugh-knees":
        hip, knee, *_ = LEGS[side]
        return 0.4 * body.joints[:, hip] + 0.6 * body.joints[:, knee] + before(body, 0, 0.06) - body.joints[:, 0]
    return None
