"""Walks and runs that go where their prompt says: straight ahead, off to a side, in a circle, an eight, or a zigzag.

A network learned ways that curve at any time and by any angle. Here the direction in which a body moves, smoothed over
its steps, is replaced by the one that is asked for, and the motion bent to that course (`marey.motion.courses`).
"""

from __future__ import annotations

import math
import random

import numpy as np
from numpy.typing import NDArray

from marey.generation.port import Limits
from marey.generation.turned import bent_along
from marey.motion.courses import Course, gradient, natural_course
from marey.motion.curves import smooth_open
from marey.motion.features import FeatureLayout, encode_all
from marey.motion.filters import smoothstep
from marey.motion.kinematics import facing
from marey.motion.rotations import Array
from marey.vocabulary.courses import ASIDE, CIRCLE, EIGHT, QUARTER, STRAIGHT, ZIGZAG, WayCourse

Float32 = NDArray[np.float32]

TREND_S = 0.5
"""Standard deviation in seconds of the smoothing of a direction: a stride is a second long."""
GOES = 0.3
"""Metres a second from which a body has a direction."""
STRAIGHT_ENOUGH = 4.0
"""Degrees by which a straight way may change its direction."""
SETS_OFF_S = 0.8
"""Seconds in which a body turns to the side to which it goes off."""
ZIGS, ZIG_S, ZIG_TURN_S = 36.0, (1.2, 1.5), 0.6
"""Degrees of the legs of a zigzag to either side, seconds of a leg, and of a turn between two."""
SPEED = {"walk": 1.15, "run": 2.7, "sprint": 3.6}
"""Metres a second of a way, about."""


CLOSED = frozenset({CIRCLE, EIGHT})
"""Courses that end where they begin."""
EIGHT_ACROSS = {"walk": (2.6, 3.2), "run": (4.4, 5.6), "sprint": (6.0, 7.0)}
"""Metres of both circles of an eight, side by side."""
CHANGES_S = 0.35
"""Standard deviation in seconds over which a body passes from one circle of an eight to the other."""


def frames_of_circle(course: WayCourse, action: str, limits: Limits) -> int:
    """Return the frames in which a body goes around a circle, or both of an eight."""
    return limits.within(
        round(math.pi * sum(_across(course, action)) / 2 / SPEED.get(action, SPEED["walk"]) * limits.fps)
    )


def _across(course: WayCourse, action: str) -> tuple[float, float]:
    return EIGHT_ACROSS.get(action, EIGHT_ACROSS["walk"]) if course.kind == EIGHT else course.across


def steered_features(features: Float32, layout: FeatureLayout, course: WayCourse, seed: int) -> Float32 | None:
    """Return features (T, D) of a way that goes where it is asked to; None if it does so by itself, or the body goes
    nowhere.

    Args:
        features: (T, D), in the layout's own units.
        layout: of the features.
        course: that is asked for.
        seed: of the motion; chooses the side where the course names none.
    """
    joints = layout.decode(features).astype(np.float64)
    natural = natural_course(joints, layout.skeleton, layout.fps)
    trend = direction(natural, layout.fps)
    if trend is None:
        return None
    aside = float(trend[0] - first_facing(joints, layout))
    if course.kind == STRAIGHT and np.degrees(max(np.ptp(trend), abs(aside))) <= STRAIGHT_ENOUGH:
        return None
    rng = random.Random(f"{seed} course")  # noqa: S311
    sign = {"left": 1.0, "right": -1.0}.get(course.side) or rng.choice((1.0, -1.0))
    passed = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(natural.places, axis=0), axis=1))])
    turns = sign * _turns(course, passed / max(passed[-1], 1e-9), layout.fps, rng)
    if course.kind not in CLOSED:
        turns -= aside * smoothstep(np.clip(np.arange(len(joints)) / layout.fps / SETS_OFF_S, 0.0, 1.0))
    wanted = _steered(natural, trend, turns)
    if course.kind in CLOSED:
        wanted = _closed(wanted, passed / max(passed[-1], 1e-9), course.across)
    return encode_all(layout, bent_along(joints, layout, natural, wanted))


def first_facing(joints: Array, layout: FeatureLayout) -> float:
    """Return the heading in which a motion (T, J, 3) begins, radians, in the turn that is nearest to 0."""
    ahead = facing(joints[:1], layout.skeleton)[0]
    return float(np.arctan2(ahead[0], ahead[2]))


def direction(natural: Course, fps: float) -> Array | None:
    """Return the direction (T,) in which a body moves, radians, smoothed over its steps; None if it hardly moves."""
    steps = smooth_open(gradient(natural.places) * fps, TREND_S * fps / 2)
    goes = np.linalg.norm(steps, axis=1) > GOES
    if goes.mean() < 0.5:
        return None
    frames = np.arange(len(steps))
    angles = np.unwrap(np.arctan2(steps[goes, 0], steps[goes, 1]))
    return smooth_open(np.interp(frames, frames[goes], angles)[:, None], TREND_S * fps)[:, 0]


def _turns(course: WayCourse, share: Array, fps: float, rng: random.Random) -> Array:
    """Return by how many radians (T,) the way turns to its first side."""
    time = np.arange(len(share)) / fps
    if course.kind == ASIDE:
        return math.radians(QUARTER) * smoothstep(np.clip(time / SETS_OFF_S, 0.0, 1.0))
    if course.kind == CIRCLE:
        return 2 * math.pi * share
    if course.kind == EIGHT:
        way = 4 * math.pi * np.minimum(share, 1.0 - share)
        return smooth_open(way[:, None], CHANGES_S * fps)[:, 0]
    angles = np.zeros(len(share))
    if course.kind == ZIGZAG:
        leg, at, way = rng.uniform(*ZIG_S), 0.0, 1.0
        while at < time[-1] - ZIG_TURN_S:
            turned = smoothstep(np.clip((time - at) / ZIG_TURN_S, 0.0, 1.0))
            angles += way * (ZIGS if at == 0 else 2 * ZIGS) * turned
            at, way = at + leg, -way
    return np.radians(angles)


def _steered(natural: Course, trend: Array, turns: Array) -> Course:
    """Return a course that moves straight ahead but for some turns (T,) in radians."""
    return natural.facing(natural.headings - (trend - trend[0]) + turns)


def _closed(course: Course, share: Array, across: tuple[float, float]) -> Course:
    """Return a course that ends where it begins, as large as it comes within some bounds in metres."""
    places = course.places - share[:, None] * (course.places[-1] - course.places[0])
    size = float(np.ptp(places, axis=0).mean())
    scale = float(np.clip(size, *across)) / max(size, 1e-9) if across[1] else 1.0
    scale = float(np.clip(scale, 0.8, 1.25))  # strides stay those of a walk
    return Course(places[0] + scale * (places - places[0]), course.headings)
