"""Bodies that push against something, standing or walking; see `marey.data.gestures`."""

from __future__ import annotations

import random

import numpy as np
from numpy.typing import NDArray

from marey.data.part import FPS, Part
from marey.data.retarget import resample_points
from marey.data.retime import LIMIT
from marey.drawing.gesture import BOTH, SIDES, Gesture
from marey.drawing.stances import settle, step
from marey.posing.bones import with_bones
from marey.posing.standing import StandingBody, envelope

Array = NDArray[np.floating]

_NECK = (12,)
_LEAST = 1.6
"""Seconds of a walk that pushes."""


def push(rng: random.Random) -> Gesture:
    return _walking(rng) if rng.random() < 0.5 else _standing(rng)


def _walking(rng: random.Random) -> Gesture:
    """A captured walk, slower or not, behind a cart or a heavy thing."""
    heavy = rng.random() < 0.5
    slower = rng.uniform(0.55, 0.8) if heavy else rng.uniform(0.8, 1.0)
    lean, sink = (rng.uniform(30, 50), rng.uniform(0.03, 0.07)) if heavy else (rng.uniform(21, 32), 0.01)
    up = rng.uniform(-0.28, -0.05) if heavy else rng.uniform(-0.36, -0.22)
    out, ahead = rng.uniform(0.14, 0.24), rng.uniform(0.33, 0.44)
    steady, head = rng.uniform(0.5, 0.9), rng.uniform(0.3, 0.7)
    elbows = (rng.uniform(0.5, 1.1), -1.0, -0.2)

    def base(part: Part) -> Array | None:
        walked = resample_points(part.joints.astype(np.float64), FPS * slower, FPS)[:LIMIT]
        return with_bones(walked) if len(walked) >= _LEAST * FPS else None

    def change(body: StandingBody) -> None:
        whole = np.ones(len(body.joints))
        body.steady(steady)
        body.shift(-sink * whole, 0.02 * whole)
        _lean(body, lean * whole, head)
        for one in SIDES:
            body.hold(one, whole, np.array([out, up, ahead]), pole=elbows)

    kinds = ("push", "push-walk", "push-heavy" if heavy else "push-cart")
    return Gesture(0.0, kinds, change, BOTH, base=base, content="walk")


def _standing(rng: random.Random) -> Gesture:
    """A body that leans against something, with one foot behind it."""
    begins = rng.random() < 0.4  # in the lean
    start, rise = (-3.0, 0.5) if begins else (rng.uniform(0.1, 0.5), rng.uniform(0.45, 0.8))
    hold = rng.uniform(2.2, 6.0)
    fall = rng.uniform(0.5, 0.9)
    released = rng.random() < 0.5
    side = rng.choice(SIDES)
    stride, lean = rng.uniform(0.22, 0.45), rng.uniform(28, 52)
    high, ahead, out = rng.uniform(-0.42, -0.18), rng.uniform(0.56, 0.7), rng.uniform(0.12, 0.24)
    waves, strength = rng.uniform(0.25, 0.6), rng.uniform(0.01, 0.03)
    sink, head, twist = rng.uniform(0.03, 0.09), rng.uniform(0.2, 0.7), rng.uniform(-6, 6)
    phase, elbows = rng.uniform(0, 6.28), (rng.uniform(0.4, 1.1), -1.0, -0.2)
    stays = hold if not begins else hold + 3.5
    end = start + rise + stays

    def change(body: StandingBody) -> None:
        frames = len(body.joints)
        t = np.arange(frames) / FPS
        way = envelope(frames, start, rise, stays if released else 60.0, fall)
        effort = way * np.sin(2 * np.pi * waves * t + phase)
        chest = body.joints[:, [16, 17]].mean(1).mean(0)
        goals = [
            body.world(np.tile([out, high, ahead], (frames, 1)), one).mean(0) + chest for one in SIDES
        ]  # the hands stay where the thing is
        step(body, side, (0.04, -stride), start - 0.1, 0.5, turn=12)
        if released:
            step(body, side, (-0.04, stride), end + 0.15, 0.5, turn=-12)
        body.shift(-sink * way, strength * effort - 0.3 * stride * way)
        _lean(body, lean * way + 60 * strength * effort, head)
        body.lean(twist * effort, "up")
        settle(body)
        for one, goal in zip(SIDES, goals, strict=True):
            target = body.from_shoulder(one, np.tile(goal, (frames, 1)))
            body.move_arm(one, way, *body.reach(one, target, elbows), 0.04)

    seconds = (end + fall + rng.uniform(0.4, 0.7)) if released else start + rise + hold + (3.5 if begins else 0.0)
    return Gesture(seconds, ("push", "push-stand"), change, BOTH, content="idle")


def _lean(body: StandingBody, degrees: Array, head: float) -> None:
    """Lean the trunk forward from the hips, the gaze staying ahead by a share `head`."""
    body.turn(0, "left", 0.35 * degrees)
    body.lean(0.65 * degrees, "left")
    body.lean(-head * 0.5 * degrees, "left", _NECK)
