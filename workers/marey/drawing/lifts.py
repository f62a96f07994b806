"""Hands that drink, reach over the head or circle around the shoulder."""

from __future__ import annotations

import random

import numpy as np
from numpy.typing import NDArray

from marey.drawing.gesture import BOTH, SIDES, Gesture
from marey.drawing.parts import GesturePace, arms_of, respond
from marey.motion.rotations import normalize
from marey.posing.limbs import FPS
from marey.posing.standing import OTHER_SIDE, RIGHT, StandingBody, direction, eased, envelope, swings

Array = NDArray[np.floating]

_HEAD, _NECK = 15, (12,)
_ARM = 0.52
"""Metres from shoulder to wrist."""
_DRINKS = {
    "drink-sip": {"stay": (0.6, 1.0), "tip": (-3, 8), "sips": (1, 1, 2, 3)},
    "drink-swig": {"stay": (0.8, 1.7), "tip": (5, 18), "sips": (1, 1, 2)},
    "drink-long": {"stay": (1.8, 3.4), "tip": (14, 30), "sips": (1,)},
    "drink-eat": {"stay": (0.55, 0.9), "tip": (-10, 2), "sips": (1, 2, 3, 4)},
}
"""Seconds at the mouth, degrees by which the head tips back, and how often the hand goes there."""


def drink(rng: random.Random) -> Gesture:
    form, side = rng.choices(list(_DRINKS), (3, 4, 3, 2))[0], rng.choice(SIDES)
    limits = _DRINKS[form]
    sips, tip = rng.choice(limits["sips"]), rng.uniform(*limits["tip"])
    start, lift, lower = rng.uniform(0.1, 1.0), rng.uniform(0.45, 0.9), rng.uniform(0.5, 1.0)
    there, back = rng.uniform(0.35, 0.75), rng.uniform(0.4, 0.8)
    times: list[tuple[float, float]] = []  # when a sip begins, and how long the hand stays
    begin = start + rng.choice([0.25 * lift, lift + rng.uniform(0.2, 1.2)])
    for _ in range(sips):
        times.append((begin, rng.uniform(*limits["stay"])))
        begin = sum(times[-1]) + there + back + rng.uniform(0.15, 1.1)
    end = sum(times[-1]) + there + rng.choice([0.1, back + rng.uniform(0.2, 1.0)])
    chest = np.array([rng.uniform(0.06, 0.2), rng.uniform(-0.3, -0.18), rng.uniform(0.22, 0.32)])
    mouth = np.array([rng.uniform(0.02, 0.08), rng.uniform(-0.1, -0.03), rng.uniform(0.14, 0.185)])
    pole = (rng.uniform(0.6, 1.3), -1.0, rng.uniform(-0.4, 0.2))
    both = form != "drink-eat" and rng.random() < 0.12
    gaze = rng.uniform(0, 10)

    def change(body: StandingBody) -> None:
        frames = len(body.joints)
        way = envelope(frames, start, lift, end - start - lift, lower)
        near = np.sum([envelope(frames, at, there, stay, back) for at, stay in times], axis=0)
        tipped = np.sum(
            [envelope(frames, at + 0.6 * there, 0.45, stay - 0.1, 0.5 * back) for at, stay in times], axis=0
        )
        body.lean(-0.2 * tip * tipped, "left")
        body.lean(gaze * way * (1 - near) - tip * tipped, "left", _NECK)
        middle = body.joints[:, [16, 17]].mean(1)
        for one in SIDES if both else (side,):
            seen = body.from_shoulder(one, middle)
            cup = body.from_shoulder(one, body.joints[:, _HEAD]) + mouth
            cup[:, 1] += 0.0015 * max(tip, 0.0) * tipped
            w = near[:, None]
            body.move_arm(one, way, *body.reach(one, (1 - w) * (seen + chest) + w * cup, pole), 0.04)

    kinds = [form] if form == "drink-eat" else ["drink", form, "drink-both" if both else "drink-side"]
    return Gesture(end + lower + rng.uniform(0.25, 1.0), tuple(kinds), change, BOTH if both else side, sips)


_TOPS = {
    "reach-up-grab": {"up": (58, 76), "out": (-15, 30), "hold": (0.3, 0.9)},
    "reach-up-stretch": {"up": (72, 87), "out": (-30, 60), "hold": (0.7, 2.2)},
    "reach-up-pick": {"up": (60, 82), "out": (-10, 70), "hold": (0.5, 1.2)},
    "reach-up-screw": {"up": (64, 80), "out": (-15, 25), "hold": (1.8, 4.0)},
}
"""Elevation and azimuth of the arm in degrees, and the seconds for which the hand stays over the head."""


def reach_up(rng: random.Random) -> Gesture:
    form = rng.choices(list(_TOPS), (4, 3, 2, 1))[0]
    side = rng.choices([*SIDES, BOTH], (4, 4, 2))[0]
    limits = _TOPS[form]
    pace = GesturePace.draw(rng, (0.6, 1.2), limits["hold"])
    up, far = rng.uniform(*limits["up"]), rng.uniform(0.95, 0.98)
    out = rng.uniform(*limits["out"]) if side != BOTH else rng.uniform(4, 25)
    heels = rng.choice([0.0, rng.uniform(10, 20), rng.uniform(20, 34)]) if form != "reach-up-screw" else 0.0
    gaze, sway, twist = rng.uniform(8, 24), rng.uniform(2, 9), rng.uniform(2, 12)
    taken = form in ("reach-up-grab", "reach-up-pick") and rng.random() < 0.65
    chest = np.array(
        [rng.uniform(0.08 if side == BOTH else 0.0, 0.14), rng.uniform(-0.26, -0.1), rng.uniform(0.24, 0.32)]
    )
    keeps = rng.uniform(0.3, 1.2) if taken else 0.0
    rate, wide = (rng.uniform(0.9, 1.6), 0.035) if form == "reach-up-screw" else (rng.uniform(1.2, 2.2), 0.015)
    free = rng.uniform(4, 16)

    def change(body: StandingBody) -> None:
        frames = len(body.joints)
        t = np.arange(frames) / FPS
        top = pace.way(body)
        way = envelope(frames, pace.start, pace.rise, pace.hold + (pace.fall + keeps if taken else 0.0), pace.fall)
        down = eased((t - pace.start - pace.rise - pace.hold) / pace.fall)[:, None] * float(taken)
        body.rise_on_toes(heels * envelope(frames, pace.start + 0.4 * pace.rise, 0.6 * pace.rise, pace.hold, 0.4))
        look = envelope(frames, max(pace.start - 0.35, 0.0), 0.4, pace.rise + pace.hold, pace.fall)
        body.lean(-gaze * look, "left", _NECK)
        respond(body, top, side, twist, sway)
        body.lean(-0.12 * gaze * top, "left")
        if side != BOTH:
            body.lift_arm(OTHER_SIDE[side], free * top)
        for one in arms_of(side):
            target = np.tile(_ARM * far * direction(out, up), (frames, 1))
            turning = 2 * np.pi * rate * t
            target += wide * (swings(top, rate) * top)[:, None] * np.array([1.0, 0.0, 0.4])
            target[:, 2] += wide * top * np.cos(turning) * float(form == "reach-up-screw")
            seen = body.from_shoulder(one, body.joints[:, [16, 17]].mean(1)) + chest
            body.move_arm(one, way, *body.reach(one, (1 - down) * target + down * seen), 0.05)

    kinds = ["reach-up", form, *(["reach-up-both"] if side == BOTH else ["reach-up-side"])]
    kinds += ["reach-up-toes"] if heels > 19 else []
    return Gesture(pace.total(rng) + (pace.fall + keeps if taken else 0.0), tuple(kinds), change, side)


_FORWARD, _BACKWARD = -1.0, 1.0


def arm_circles(rng: random.Random, *, times: int | None = None) -> Gesture:
    form = rng.choices(["circles-one", "circles-both", "circles-mill"], (4, 4, 2))[0]
    side = rng.choice(SIDES) if form == "circles-one" else BOTH
    across = form != "circles-mill" and rng.random() < 0.22
    way_round = rng.choice((_FORWARD, _BACKWARD))
    tempo = rng.choice(["slow", "", "", "fast"])
    rate = {"slow": rng.uniform(0.35, 0.5), "": rng.uniform(0.5, 0.9), "fast": rng.uniform(0.9, 1.4)}[tempo]
    number = times or rng.randint(1, max(2, int(6.0 * rate)))
    ramp = 0.45 / rate
    start, late = rng.uniform(0.1, 0.8), 0.5 / rate if form == "circles-mill" else 0.0
    whole = max(number / rate - ramp, 0.05)
    seconds = start + whole + 2 * ramp + late + rng.uniform(0.3, 1.0)
    wide, behind, bent = rng.uniform(0.1, 0.25), rng.uniform(0.35, 0.6), rng.uniform(0, 14)
    follow, first = rng.uniform(1, 5), rng.choice(SIDES)

    def change(body: StandingBody) -> None:
        frames = len(body.joints)
        angles = {one: _turned(frames, start + (late if one != first else 0.0), ramp, whole) for one in arms_of(side)}
        turns = {one: 2 * np.pi * number * way_round * angle for one, angle in angles.items()}
        mean = np.mean(list(turns.values()), axis=0)
        body.shift(0.012 * (np.cos(mean) - 1) * (form != "circles-mill"))
        if side != BOTH:
            sign = 1.0 if side == RIGHT else -1.0
            body.lean(sign * follow * np.sin(mean), "up", (6, 9))
        body.lean(-follow * 0.5 * (1 - np.cos(mean)), "left")
        for one, angle in turns.items():
            way = envelope(frames, max(start - 0.3, 0.0), 0.35, seconds - start - 0.5, 0.45)
            before = 0.2 if one == first else 0.5  # hands that cross pass one before the other
            upper = _across(angle, before) if across else _around(angle, wide, behind)
            fore = normalize(upper + np.tan(np.radians(bent)) * np.array([-0.2, 0.0, 1.0]))
            body.move_arm(one, way, upper, fore, 0.0, straight=True)

    kinds = ["circles", form, *([f"circles-{tempo}"] if tempo else [])]
    if not across:
        kinds.append("circles-forward" if way_round == _FORWARD else "circles-backward")
    return Gesture(seconds, tuple(kinds), change, side, number)


def _turned(frames: int, start: float, ramp: float, whole: float) -> Array:
    """Share of all turning done, from 0 to 1, with a soft start and end."""
    pace = envelope(frames, start, ramp, whole, ramp)
    return np.cumsum(pace) / pace.sum()


def _around(angle: Array, wide: float, behind: float) -> Array:
    """Directions (T, 3) of an arm in the body's frame, at an angle from hanging; positive angles lead to the front."""
    up, ahead = -np.cos(angle), np.sin(angle)
    return normalize(np.stack([wide + behind * np.clip(-ahead, 0, 1) + 0.1 * (1 + up), up, ahead], axis=-1))


def _across(angle: Array, before: float) -> Array:
    """Like `_around` in the plane of the chest, `before` it; positive angles lead outward."""
    up, out = -np.cos(angle), np.sin(angle)
    return normalize(np.stack([out + 0.12, up, before + 0.8 * np.clip(-out, 0, 1)], axis=-1))
