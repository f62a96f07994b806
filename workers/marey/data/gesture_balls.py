"""Balls that are dribbled on the spot or at a walk; see `marey.data.gestures`."""

from __future__ import annotations

import random

import numpy as np
from numpy.typing import NDArray

from marey.data.gesture_drawing import SIDES, Gesture
from marey.data.gesture_poses import LEFT, RIGHT, StandingBody, eased, envelope
from marey.data.gesture_stances import settle, step
from marey.data.part import FPS, Part
from marey.data.retime import LIMIT

Array = NDArray[np.floating]

_OTHER = {LEFT: RIGHT, RIGHT: LEFT}
_NECK = (12,)
_LEAST_STROKES = 5


def dribble(rng: random.Random) -> Gesture:
    walks = rng.random() < 0.35
    low, crosses = not walks and rng.random() < 0.35, not walks and rng.random() < 0.3
    side = rng.choice(SIDES)
    rate = rng.uniform(1.9, 2.7) if low else rng.uniform(1.25, 2.1)
    strong = rng.uniform(0.07, 0.1) if low else rng.uniform(0.09, 0.15)
    bent = rng.uniform(26, 42) if low else rng.uniform(10, 26)
    bent = 0.6 * bent if walks else bent
    sink = rng.uniform(0.08, 0.16) if low else rng.uniform(0.02, 0.09)
    sink = 0.3 * sink if walks else sink
    begins = walks or rng.random() < 0.4
    start, rise, fall = -2.0 if begins else rng.uniform(0.1, 0.5), 0.5, rng.uniform(0.5, 0.8)
    strokes = rng.randint(_LEAST_STROKES, 10) if not crosses else rng.choice((8, 9, 10, 12))
    hold = strokes / rate
    end = max(start, -rise) + rise + hold
    ends = not walks and rng.random() < 0.6
    up = rng.uniform(0.02, 0.08) if low else rng.uniform(0.08, 0.16)
    place = np.array([rng.uniform(0.18, 0.26), up, rng.uniform(0.26, 0.36)])
    guard = np.array([rng.uniform(0.12, 0.26), rng.uniform(-0.36, -0.2), rng.uniform(0.14, 0.3)])
    guards = crosses or rng.random() < 0.6
    wide, back = rng.uniform(0.02, 0.08), rng.uniform(0.0, 0.2)
    gaze, phase = rng.uniform(-0.4, 0.2), rng.uniform(0, 6.28)
    every = rng.choice((4, 5)) / rate

    def base(part: Part) -> Array | None:
        joints = part.joints[:LIMIT].astype(np.float64)
        return joints if len(joints) * rate >= (_LEAST_STROKES + 1) * FPS else None

    def change(body: StandingBody) -> None:
        frames = len(body.joints)
        t = np.arange(frames) / FPS
        way = envelope(frames, start, rise, end - start - rise if ends else 60.0, fall)
        beat = 2 * np.pi * rate * t + phase
        stroke = strong * (np.cos(beat) + 0.16 * np.cos(2 * beat))
        if not walks:
            _stand_apart(body, side, (wide, back), start - 0.1, end if ends else None)
            body.shift(np.zeros(frames), -0.35 * back * way)
        body.shift(-sink * way - 0.06 * strong * way * (1 - np.cos(beat + 0.6)))
        body.bow((bent - 12 * stroke) * way, arms_hang=0.8, head=gaze)
        if not walks:
            settle(body)
        turn = _turns(t, every, crosses=crosses)
        hips = body.joints[:, 0]
        for one, active in ((side, 1 - turn), (_OTHER[side], turn)):
            if one != side and not guards:
                body.lift_arm(one, 8 * way)
                continue
            seen = body.from_shoulder(one, hips)
            ball = seen + place + stroke[:, None] * np.array([0.0, 1.0, -0.12])
            inward = 4 * turn * (1 - turn)
            ball[:, 0] -= 0.16 * inward
            waits = body.from_shoulder(one, body.joints[:, [16, 17]].mean(1)) + guard
            w = active[:, None]
            body.move_arm(one, way, *body.reach(one, w * ball + (1 - w) * waits, (0.6, -0.6, -0.8)), 0.02)

    kinds = ["dribble", "dribble-low" if low else "dribble-high"]
    kinds += ["dribble-walk" if walks else "dribble-stand", "dribble-cross" if crosses else "dribble-hand"]
    seconds = end + (fall + 0.5 if ends else 0.0)
    content, base_of = ("walk", base) if walks else ("idle", None)
    return Gesture(min(seconds, 9.6), tuple(kinds), change, side, base=base_of, content=content)


def _stand_apart(body: StandingBody, side: str, apart: tuple[float, float], start: float, end: float | None) -> None:
    """Step apart at `start`, the foot of the ball back, and together again at `end` seconds.

    Args:
        side: of the hand that has the ball first.
        apart: metres of each foot outward, and of that foot back.
    """
    wide, back = apart
    for one, ahead, waits in ((side, -back, 0.1), (_OTHER[side], 0.3 * back, 0.4)):
        step(body, one, (wide, ahead), start, 0.4)
        if end is not None:
            step(body, one, (-wide, -ahead), end + waits, 0.4)


def _turns(t: Array, every: float, *, crosses: bool) -> Array:
    """0 while the first hand has the ball, 1 while the other has it, (T,)."""
    if not crosses:
        return np.zeros_like(t)
    within = np.mod(t, 2 * every)
    return eased((within - every + 0.1) / 0.2) * (1 - eased((within - 2 * every + 0.1) / 0.2))
