"""Climbs made of captured ones in the other direction, slow enough to be played backward in time."""

from __future__ import annotations

import random
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from marey.data.part import FPS, Part
from marey.data.retarget import resample_points
from marey.data.retime import LIMIT
from marey.drawing.gesture import Gesture
from marey.posing.bones import with_bones

Array = NDArray[np.floating]

_PACES = (0.82, 1.22)
_CLIMBS = (0.4, 0.25)  # metres that the hips rise onto something, and on a ladder
_FALLS = 1.3  # m/s downward; faster ones drop and are not played backward
_SHORTEST = 24  # frames


def is_climb_down(part: Part) -> bool:
    """Return True for a captured slow climb down from something."""
    return _is_slow(part, "climb-down", _CLIMBS[0])


def is_ladder(part: Part) -> bool:
    """Return True for a captured climb up or down a ladder."""
    return _is_slow(part, "climb-ladder", _CLIMBS[1])


def _is_slow(part: Part, content: str, least: float) -> bool:
    height = part.joints[:, 0, 1]
    falls = float(-np.diff(height).min(initial=0.0)) * FPS
    return (
        part.content == content and len(part.joints) > _SHORTEST and abs(_rise(part.joints)) > least and falls < _FALLS
    )


def _rise(joints: Array) -> float:
    return float(joints[-1, 0, 1] - joints[0, 0, 1])


def climb_onto(rng: random.Random) -> Gesture:
    return Gesture(0.0, ("climb-onto",), lambda body: None, base=_climbing(rng, up=True))


def climb_ladder(rng: random.Random) -> Gesture:
    up = rng.random() < 0.6
    untrue = r"\bdown|desce|rappel|abseil" if up else r"\bup|ascend|scale|clamber|climb( a| the)? (rope|tree|wall)"
    key = "ladder-up" if up else "ladder-down"
    return Gesture(0.0, (key,), lambda body: None, base=_climbing(rng, up=up), untrue=untrue)


def _climbing(rng: random.Random, *, up: bool) -> Callable[[Part], Array | None]:
    pace = rng.uniform(*_PACES)

    def base(part: Part) -> Array | None:
        joints = part.joints[::-1].astype(np.float64)
        if (_rise(joints) > 0) != up:
            return None
        return with_bones(resample_points(joints, FPS * pace, FPS))[:LIMIT]

    return base
