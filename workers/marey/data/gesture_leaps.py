"""Leaps made of captured runs: one flight is made longer and higher, the legs apart."""

from __future__ import annotations

import random

import numpy as np
from numpy.typing import NDArray

from marey.data.gesture_gaits import speed_of
from marey.data.part import FPS, Part
from marey.data.retarget import resample_points
from marey.data.retime import LIMIT, loop
from marey.drawing.gesture import Gesture
from marey.motion.rotations import from_rotvec, rotate
from marey.posing.bones import with_bones
from marey.posing.limbs import GRAVITY, LEG_CHAINS
from marey.posing.standing import ARMS, LEFT, RIGHT, StandingBody

Array = NDArray[np.floating]

_TOES = [10, 11]
_ALOFT = 0.05  # metres of both toes over the floor
_FLIGHTS = (0.36, 0.56)  # seconds
_HIGH = 0.48  # seconds of a flight that is called high or long
_RUN_FLIGHT = 2.5  # frames that both feet of a run are in the air already
_SPLIT = np.radians(108.0)  # between the thighs in a leap that is called split
_FRONT = 0.6  # share of the spread of the legs by the one in front
_RUN_RISE = 0.03  # metres that its hips rise in them


def leap(rng: random.Random) -> Gesture:
    seconds, pace, flight = rng.uniform(2.0, 4.2), rng.uniform(0.9, 1.12), rng.uniform(*_FLIGHTS)
    at = rng.uniform(0.4, 0.65)
    apart, straighten = np.radians(rng.uniform(75, 125)), rng.uniform(0.3, 0.85)
    opened, raised = rng.uniform(5, 55), rng.uniform(0, 25)

    def base(part: Part) -> Array | None:
        frames = round(seconds * FPS * pace)
        looped = loop(part, frames) if len(part.joints) < frames else (part.joints[:frames].astype(np.float64),)
        if looped is None:
            return None
        joints = with_bones(resample_points(looped[0], FPS * pace, FPS))
        middle = _flight_near(joints, at * len(joints))
        if middle is None:
            return None
        return _leapt(joints, middle, flight, speed_of(joints), (apart, straighten), (opened, raised))

    wide = apart > _SPLIT
    kinds = ("leap", *(["leap-high"] if flight > _HIGH else []), *(["leap-split"] if wide else []))
    return Gesture(0.0, kinds, lambda body: None, base=base, untrue="" if wide else "jete|split")


def _flight_near(joints: Array, at: float) -> float | None:
    """Middle of the flight of a run (T, 22, 3) that is nearest to a frame, None without one of two frames."""
    toes = joints[:, _TOES, 1].min(1)
    aloft = np.concatenate([[False], toes > toes.min() + _ALOFT, [False]])
    edges = np.flatnonzero(aloft[1:] != aloft[:-1]).reshape(-1, 2)
    middles = [(a + b - 1) / 2 for a, b in edges if b - a >= 2 and a > 8 and b < len(joints) - 8]
    return min(middles, key=lambda middle: abs(middle - at), default=None)


def _leapt(
    joints: Array, middle: float, flight: float, speed: float, legs: tuple[float, float], arms: tuple[float, float]
) -> Array | None:
    """Make one flight of a run (T, 22, 3) longer.

    Args:
        joints: the run.
        middle: frame in the middle of the flight.
        flight: its new length, seconds.
        speed: of the run, m/s; it stays.
        legs: radians between the thighs, and share by which the knees are stretched.
        arms: degrees by which the arms are spread and the forearms opened.
    """
    more = max(flight * FPS - _RUN_FLIGHT, 0.0)
    total = len(joints) + int(more)
    if total > LIMIT:
        return None
    t = np.arange(total, dtype=np.float64)
    centre = middle + more / 2
    share = np.clip((t - centre) / (flight * FPS) + 0.5, 0.0, 1.0)
    source = t - more * (share - np.sin(2 * np.pi * share) / (2 * np.pi))
    source = np.minimum(source, len(joints) - 1)
    below = np.clip(source.astype(int), 0, len(joints) - 2)
    part = (source - below)[:, None, None]
    out = (1 - part) * joints[below] + part * joints[below + 1]
    way = (joints[-1, 0] - joints[0, 0]) * np.array([1.0, 0.0, 1.0])
    out += ((t - source) / FPS * speed)[:, None, None] * way / np.linalg.norm(way)
    fly = np.sin(np.pi * share) ** 2
    out[..., 1] += (GRAVITY / 8 * flight**2 - _RUN_RISE) * (0.5 * fly + 2 * share * (1 - share))[:, None]
    body = StandingBody(with_bones(out))
    _spread(body, round(centre), fly, *legs)
    for side, sign in ((LEFT, 1.0), (RIGHT, -1.0)):
        body.turn(ARMS[side][1], "forward", -sign * arms[0] * fly)
        body.turn(ARMS[side][2], "left", arms[1] * fly)
    return body.solved()


def _spread(body: StandingBody, middle: int, fly: Array, apart: float, straighten: float) -> None:
    """Spread the thighs to `apart` radians in frame `middle`, and stretch the knees, by `fly` (T,)."""
    thighs = [body.local(body.joints[:, knee] - body.joints[:, hip], LEFT)[middle] for hip, knee, *_ in LEG_CHAINS]
    toward = [float(np.arctan2(thigh[2], -thigh[1])) for thigh in thighs]
    front, more = int(np.argmax(toward)), max(apart - abs(toward[0] - toward[1]), 0.0)
    left = body.world(np.tile([1.0, 0.0, 0.0], (len(fly), 1)), LEFT)
    for side, (hip, knee, ankle, toe) in enumerate(LEG_CHAINS):
        angle = -_FRONT * more if side == front else (1 - _FRONT) * more
        _turn(body.joints, hip, [knee, ankle, toe], left * (angle * fly)[:, None])
        thigh, shank = (body.joints[:, b] - body.joints[:, a] for a, b in ((hip, knee), (knee, ankle)))
        cosine = np.einsum("ti,ti->t", thigh, shank) / np.linalg.norm(thigh, axis=-1) / np.linalg.norm(shank, axis=-1)
        bend = np.maximum(np.arccos(np.clip(cosine, -1, 1)) - 0.15, 0.0)
        _turn(body.joints, knee, [ankle, toe], left * (-straighten * bend * fly)[:, None])


def _turn(joints: Array, pivot: int, moved: list[int], turns: Array) -> None:
    about = joints[:, pivot : pivot + 1]
    joints[:, moved] = about + rotate(from_rotvec(turns)[:, None], joints[:, moved] - about)
