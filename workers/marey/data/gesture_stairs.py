"""Steps of a captured idle up and down stairs, and a few steps back from standing."""

from __future__ import annotations

import random

import numpy as np
from numpy.typing import NDArray

from marey.data.gesture_idles import is_plain_idle, of_length
from marey.data.part import FPS, Part
from marey.drawing.footsteps import Footstep, Manner, stepped
from marey.drawing.gesture import Gesture
from marey.motion.filters import smooth_seconds
from marey.posing.standing import ARMS, LEFT, RIGHT, StandingBody, eased

Array = NDArray[np.floating]

_PACES = {"quick": (0.34, 0.42), "": (0.48, 0.64), "slow": (0.75, 1.0)}  # seconds a stair
_RISES, _TREADS = (0.14, 0.2), (0.25, 0.33)  # metres
_TOES = [10, 11]
_SWING = 0.9  # of the time to the next step


def climb_stairs(rng: random.Random) -> Gesture:
    up = rng.random() < 0.55
    pace = rng.choices(list(_PACES), (1, 3, 1))[0]
    interval, rise, tread = rng.uniform(*_PACES[pace]), rng.uniform(*_RISES), rng.uniform(*_TREADS)
    stairs, foot, goes_on = rng.randint(3, 9), rng.randint(0, 1), rng.random() < 0.5
    start = -rng.uniform(1.0, 2.0) * interval if goes_on else rng.uniform(0.15, 0.8)
    steps = _steps(start, interval, stairs + 3 * goes_on, foot, rise if up else -rise, tread)
    end = steps[-1].start + interval
    seconds = end - rng.uniform(1.2, 2.0) * interval if goes_on else end + rng.uniform(0.3, 1.0)
    manner = Manner(rng.uniform(0.05, 0.1) if up else rng.uniform(0.03, 0.06), rng.uniform(12, 30), 0.03, 0.0)
    stoop, swing, gaze = rng.uniform(3, 14) if up else rng.uniform(-3, 6), rng.uniform(6, 20), rng.uniform(0, 14)

    def change(body: StandingBody) -> None:
        moving = _moving(body, start, end)
        body.lean(stoop * moving, "left")
        body.turn(12, "left", gaze * moving)
        _swing_arms(body, steps, swing)
        floor = body.joints[:, _TOES, 1].min()
        body.joints[:] = stepped(body.joints, steps, manner)
        body.joints[..., 1] += floor - body.joints[:, _TOES, 1].min()

    way = "stairs-up" if up else "stairs-down"
    untrue = r"\bdown|desce" if up else r"\bup|ascend|climb|onto"
    untrue += "" if pace == "quick" else r"|\brun"
    return Gesture(seconds, (way, way, f"{way}-{pace}" if pace else way), change, untrue=untrue)


def steps_back(rng: random.Random) -> Gesture:
    """A few steps back from standing, and standing again."""
    interval, length, count = rng.uniform(0.36, 0.62), rng.uniform(0.22, 0.4), rng.randint(3, 6)
    start, foot = rng.uniform(0.2, 1.2), rng.randint(0, 1)
    steps = _steps(start, interval, count, foot, 0.0, -length)
    end = steps[-1].start + interval
    manner, stoop, swing = Manner.draw(rng), rng.uniform(-6, 4), rng.uniform(3, 14)

    def change(body: StandingBody) -> None:
        body.lean(stoop * _moving(body, start, end), "left")
        _swing_arms(body, steps, swing)
        body.joints[:] = stepped(body.joints, steps, manner)

    seconds = end + rng.uniform(0.3, 1.2)

    def base(part: Part) -> Array | None:
        return of_length(part.joints, round(seconds * FPS), rng) if is_plain_idle(part) else None

    return Gesture(seconds, ("backward", "backward-stop"), change, base=base, untrue="run|jog")


def _steps(start: float, interval: float, count: int, foot: int, rise: float, length: float) -> list[Footstep]:
    """Steps in alternation, each `length` farther and `rise` higher, and a last one beside the other foot."""
    steps = list[Footstep]()
    for k in range(1, count + 2):
        far = min(k, count)
        at = start + (k - 1) * interval
        steps.append(Footstep((foot + k - 1) % 2, at, _SWING * interval, up=far * rise, forward=far * length))
    return steps


def _moving(body: StandingBody, start: float, end: float) -> Array:
    t = np.arange(len(body.joints)) / FPS
    return eased((t - start + 0.3) / 0.6) * (1 - eased((t - end + 0.2) / 0.6))


def _swing_arms(body: StandingBody, steps: list[Footstep], degrees: float) -> None:
    """Swing each arm forward with the step of the other foot."""
    t = np.arange(len(body.joints)) / FPS
    phase = np.zeros(len(t))
    for step in steps:
        share = np.clip((t - step.start) / step.seconds, 0.0, 1.0)
        phase += (1 if step.foot == 0 else -1) * np.sin(np.pi * share) * np.sign(step.forward)
    phase = smooth_seconds(phase, 0.12, FPS)
    for side, sign in ((LEFT, 1.0), (RIGHT, -1.0)):
        _, shoulder, elbow, _ = ARMS[side]
        swung = sign * degrees * phase
        body.turn(shoulder, "left", swung)
        body.turn(elbow, "left", -0.4 * np.maximum(-swung, 0.0))
