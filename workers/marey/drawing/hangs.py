"""Bodies that hang by both hands from a bar or a ledge."""

from __future__ import annotations

import math
import random
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from marey.drawing.gesture import SIDES, Gesture
from marey.drawing.passing import pose
from marey.drawing.postures import FootPlace, HandPlace, Point, Posture
from marey.drawing.sequels import Sequel, near
from marey.motion.rotations import from_rotvec, rotate
from marey.motion.skeleton import HUMANML3D
from marey.posing.bones import two_bones
from marey.posing.limbs import FPS
from marey.posing.standing import ARMS, LEFT, RIGHT, StandingBody, eased

Array = NDArray[np.floating]

_WRISTS = [20, 21]
_SHOULDERS, _HALF, _ARM = 0.495, 0.168, 0.516
"""Metres from the hips up to the shoulders with lifted collars, from the middle out to them, and of a straight arm."""
_BEHIND = 0.04
"""Metres of the hips behind the bar."""
_ELBOW: Point = (1.0, 0.0, 0.35)
_SHRUG = 16.0
"""Degrees by which the collars are lifted."""
_LEGS = {
    "straight": ((0.09, -0.82, -0.03), (0.05, -0.85, 0.5), (0.1, 0.0, 1.0)),
    "bent": ((0.09, -0.6, -0.34), (0.0, -0.75, -0.65), (0.1, -0.4, 1.0)),
    "tucked": ((0.09, -0.42, 0.2), (0.0, -0.6, 0.8), (0.1, 0.3, 1.0)),
    "ledge": ((0.12, -0.68, 0.16), (0.1, -0.45, 0.9), (0.5, 0.2, 1.0)),
}
"""A foot below the hips, outward, up and forward, where its toes point and where its knee points."""


def _hanging(rng: random.Random, bar: Point, down: float, legs: str, kick: Point = (0.0, 0.0, 0.0)) -> Posture:
    """A body whose hips are `down` metres below the bar; `kick`: metres by which the left foot is moved, and the right
    one the other way."""
    out, up, ahead = bar
    at, toes, knee = _LEGS[legs]
    high = up - down
    feet = {}
    for side, sign in ((LEFT, 1.0), (RIGHT, -1.0)):
        moved = np.array(at) + sign * np.array(kick) + np.array([0.0, high, ahead - _BEHIND])
        feet[side] = FootPlace(near(rng, (moved[0], moved[1], moved[2]), 0.008), toes)
    hand = HandPlace((out, up, ahead), "floor", _ELBOW)
    posture = Posture((0.0, high, ahead - _BEHIND), (0, 0, 0), (2, 0, 0), (-6, 0, 0), 0.0, dict.fromkeys(SIDES, hand))
    return replace(posture, feet=feet, knees=dict.fromkeys(SIDES, knee))


def hang(rng: random.Random) -> Gesture:
    form = rng.choices(
        ["hang-still", "hang-swing", "hang-side", "hang-kick", "hang-pull", "hang-raise"], (4, 5, 3, 3, 3, 2)
    )[0]
    ledge = form in ("hang-still", "hang-kick", "hang-pull") and rng.random() < 0.35
    legs = "ledge" if ledge else _legs(rng, form)
    seconds = rng.uniform(2.2, 7.5)
    bar: Point = (rng.uniform(0.18, 0.32), rng.uniform(2.25, 2.75), rng.uniform(0.02, 0.1))
    reach = _SHOULDERS + math.sqrt(_ARM**2 - (bar[0] - _HALF) ** 2 - _BEHIND**2)
    swing = {"hang-swing": rng.uniform(10, 30), "hang-side": rng.uniform(5, 10)}.get(form, rng.uniform(0.5, 2.0))
    if form == "hang-side":  # the shoulders roll, one of them down
        reach -= _HALF * math.sin(math.radians(swing))
    still = _hanging(rng, bar, reach, legs)
    done = Sequel([rng.uniform(0.1, 0.5)], [still])
    while done.times[-1] < seconds:
        _move(rng, done, form, bar, reach, legs)
    axis = "forward" if form == "hang-side" else "left"
    rate, phase = rng.uniform(0.38, 0.5), rng.uniform(0, 6.3)
    whip = rng.uniform(0.2, 0.5)

    def change(body: StandingBody) -> None:
        body.shrug(np.full(len(body.joints), _SHRUG))
        pose(body, done.times, done.postures)
        t = np.arange(len(body.joints)) / FPS
        grown = 0.75 + 0.25 * eased(t / 2.0)
        angle = swing * grown * np.sin(2 * np.pi * rate * t + phase)
        legs_behind = swing * whip * grown * np.sin(2 * np.pi * rate * t + phase - 0.9)
        hands = body.joints[:, _WRISTS].copy()
        _swing(body, axis, angle, legs_behind)
        if axis == "forward":
            _hold_on(body, hands)

    told = ["hang", form, "hang-ledge" if ledge else "", "hang-bar" if not ledge else ""]
    untrue = ["rope", "bar" if ledge else "ledge", *(["swing"] if form != "hang-swing" else [])]
    untrue += ["pull"] if form != "hang-pull" else []
    seconds = done.times[-1] + rng.uniform(0.2, 0.5)
    return Gesture(seconds, tuple(filter(None, told)), change, untrue="|".join(untrue))


def _legs(rng: random.Random, form: str) -> str:
    """Draw how the legs hang from a bar, a key of `_LEGS`."""
    legs = rng.choices(["straight", "bent", "tucked"], (6, 3, 0 if form == "hang-raise" else 1))[0]
    if form == "hang-swing":
        return rng.choice(["straight", "straight", "bent"])
    return "straight" if form == "hang-raise" else legs


def _move(rng: random.Random, done: Sequel, form: str, bar: Point, reach: float, legs: str) -> None:
    """Add one pull, raise of the legs, kick or look to a sequence of a body that hangs.

    Args:
        reach: metres from the bar to the hips while it only hangs.
    """
    if form == "hang-pull":
        neck = (-14.0, 0.0, 0.0)
        top = _hanging(rng, bar, rng.uniform(0.6, 0.68), legs)
        done.then(rng.uniform(0.6, 1.1), replace(top, neck=neck, spine=(-4, 0, 0)), rng.uniform(0.05, 0.4))
        done.then(rng.uniform(0.7, 1.2), _hanging(rng, bar, reach, legs), rng.uniform(0.2, 0.8))
    elif form == "hang-raise":
        done.then(rng.uniform(0.6, 1.0), _hanging(rng, bar, reach, "tucked"), rng.uniform(0.1, 0.4))
        done.then(rng.uniform(0.6, 1.0), _hanging(rng, bar, reach, legs), rng.uniform(0.2, 0.6))
    elif form == "hang-kick":
        far = rng.uniform(0.08, 0.2)
        for sign in (1.0, -1.0):
            kick = (0.0, 0.25 * far if legs == "ledge" else 0.0, sign * far)
            done.then(rng.uniform(0.28, 0.45), _hanging(rng, bar, reach, legs, kick))
    else:
        moved = _hanging(rng, bar, reach + rng.uniform(-0.012, 0.0), legs)
        look = rng.uniform(-35, 35) if rng.random() < 0.4 else 0.0
        done.then(rng.uniform(0.8, 1.4), replace(moved, neck=(rng.uniform(-14, 8), 0, look)), rng.uniform(0.1, 0.6))


def _swing(body: StandingBody, axis: str, degrees: Array, legs: Array) -> None:
    """Turn a body about the bar by degrees (T,), and the legs about the hips by `legs` (T,) more.

    Args:
        body: it hangs.
        axis: `left`: to and fro; `forward`: from side to side.
        degrees, legs: positive to the back, or to the body's right.
    """
    frames = len(body.joints)
    unit = [1.0, 0.0, 0.0] if axis == "left" else [0.0, 0.0, 1.0]
    along = body.world(np.tile(unit, (frames, 1)), LEFT)
    lower = [4, 5, 7, 8, 10, 11]
    for joints, pivot, angle in (
        (lower, body.joints[:, :1], legs),
        (list(range(22)), body.joints[:, _WRISTS].mean(1, keepdims=True).mean(0, keepdims=True), degrees),
    ):
        turned = from_rotvec(along * np.radians(angle)[:, None])[:, None]
        body.joints[:, joints] = pivot + rotate(turned, body.joints[:, joints] - pivot)


def _hold_on(body: StandingBody, hands: Array) -> None:
    """Put both wrists back to where they were, (T, 2, 3), and solve the arms."""
    frames = len(body.joints)
    for (side, (_, shoulder, elbow, wrist)), place in zip(ARMS.items(), np.moveaxis(hands, 1, 0), strict=True):
        pole = body.world(np.tile(_ELBOW, (frames, 1)), side)
        upper, lower = (float(np.linalg.norm(HUMANML3D.offsets[joint])) for joint in (elbow, wrist))
        body.joints[:, elbow], body.joints[:, wrist] = two_bones(body.joints[:, shoulder], place, pole, (upper, lower))
