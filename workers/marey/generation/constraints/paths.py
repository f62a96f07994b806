"""Paths of the root: the course that a motion takes to follow one; the two are matched by time."""

from __future__ import annotations

import numpy as np

from marey.generation.constraints.constraint_set import ConstraintSet
from marey.motion.courses import Course, gradient, turned
from marey.motion.curves import hump, smooth_open, through
from marey.motion.filters import smooth
from marey.motion.rotations import Array

ASKED_S = 0.1
TURN_S = 0.2
SLOW = 0.3
"""Metres a second at which a direction of travel has half its weight."""
FACING_S = 0.5
NEAR_START, NEARLY_AHEAD, TURN_AHEAD_S = 0.05, 0.6, 0.6
"""Metres and radians up to which a path begins as every clip does; the difference fades within so many seconds."""


def asked_places(asked: ConstraintSet) -> tuple[Array, int]:
    """Return the path asked for (T, 2) with straight ends, and the frame in which it ends.

    A path that begins later than frame 0 is reached from the origin, where every clip begins.
    """
    frames = np.concatenate([path.frames for path in asked.paths])
    places = np.concatenate([path.places for path in asked.paths])
    order = np.argsort(frames, kind="stable")
    frames, places = frames[order], places[order]
    if frames[0] >= 1:
        frames, places = np.concatenate([[0.0], frames]), np.concatenate([np.zeros((1, 2)), places])
    at = np.arange(asked.frames, dtype=np.float64)
    end = min(int(np.floor(frames[-1] + 1e-6)), asked.frames - 1)
    return smooth_open(through(frames, places, at), ASKED_S * asked.fps), end


def course_asked(asked: ConstraintSet, natural: Course) -> Course:
    """Return the course for a motion with the natural one (T): the path asked for, and the heading that the motion has
    to it, or the one asked for. Behind the end of the path the motion goes on by itself."""
    places, end = asked_places(asked)
    at = np.arange(asked.frames, dtype=np.float64)
    relative = _across_travel(natural, asked.fps)
    headings = directions(places, asked.fps, natural.headings[0] + relative[0]) - relative
    for path in asked.paths:
        if path.headings is not None:
            inside = (at >= path.frames[0] - 0.5) & (at <= path.frames[-1] + 0.5)
            given = through(path.frames, path.headings[:, None], at)[:, 0]
            given += 2 * np.pi * np.round(np.median((headings - given)[inside]) / (2 * np.pi))
            headings = np.where(inside, given, headings)
    turn = headings - natural.headings
    turn = smooth_open(np.unwrap(turn)[:, None], TURN_S * asked.fps)[:, 0]
    turn -= 2 * np.pi * np.round(turn[0] / (2 * np.pi))
    turn[end + 1 :] = turn[end]
    if np.linalg.norm(places[0]) <= NEAR_START and abs(turn[0]) <= NEARLY_AHEAD:
        turn -= turn[0] * hump(at / (TURN_AHEAD_S * asked.fps))
        places = places - places[0] * hump(at / (TURN_AHEAD_S * asked.fps))[:, None]
    after = natural.places[end + 1 :] - natural.places[end]
    places = np.concatenate([places[: end + 1], places[end] + turned(after, turn[end])])
    return Course(smooth_open(places, 0.5 * ASKED_S * asked.fps), natural.headings + turn)


def _weighted_directions(places: Array, fps: float) -> tuple[Array, Array]:
    """Return the direction of travel (T,) in radians, and its weight (T,): little where there is hardly any."""
    step = gradient(places) * fps
    speed = np.linalg.norm(step, axis=1)
    return np.arctan2(step[:, 0], step[:, 1]), speed**2 / (speed**2 + SLOW**2)


def directions(places: Array, fps: float, otherwise: float) -> Array:
    """Return the direction of travel (T,) in radians, unwrapped; where there is none, that of the nearest moments."""
    angle, weight = _weighted_directions(places, fps)
    seen = np.stack([weight * np.cos(angle), weight * np.sin(angle)], axis=1)
    mixed = sum(share * smooth(seen, sigma * fps) for share, sigma in ((1.0, 0.08), (1e-2, 0.5), (1e-4, 3.0)))
    mixed = mixed + 1e-7 * np.array([np.cos(otherwise), np.sin(otherwise)])
    return np.asarray(np.unwrap(np.arctan2(mixed[:, 1], mixed[:, 0])), np.float64)


def _across_travel(natural: Course, fps: float) -> Array:
    """Return the direction in which a motion travels, from its heading (T,): 0 forwards, pi backwards."""
    angle, weight = _weighted_directions(natural.places, fps)
    relative = angle - natural.headings
    seen = np.stack([weight * np.cos(relative) + 0.05, weight * np.sin(relative)], axis=1)
    mixed = smooth(seen, FACING_S * fps)
    return np.asarray(np.unwrap(np.arctan2(mixed[:, 1], mixed[:, 0])), np.float64)
