"""Ways of a body over the floor, from one posture to another, with the turns of who lies and rolls over."""

from __future__ import annotations

import random
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from marey.drawing.dives import side_dive
from marey.drawing.gesture import Gesture
from marey.drawing.holds import (
    BACK,
    BEGINS_S,
    FOURS,
    FRONT,
    KNEES,
    LEFT_SIDE,
    PLANK,
    PRONE,
    SIDES_DOWN,
    UPRIGHT,
    passing,
)
from marey.drawing.low_deeds import POUNDS, LowDeed
from marey.drawing.passing import pose
from marey.drawing.rolling_over import rolled_over
from marey.motion.rotations import about, rotate
from marey.posing.limbs import FPS, LEVEL
from marey.posing.standing import LEFT, RIGHT, StandingBody
from marey.posing.still import standing_still

Array = NDArray[np.floating]

FLAT = frozenset({BACK, FRONT}) | SIDES_DOWN
"""Postures from which a body rolls over into each other."""
OPPOSITE = {BACK: FRONT, FRONT: BACK}
"""Where who rolls over comes to lie."""
_ON_FRONT = frozenset({FOURS, PLANK, PRONE, FRONT})
"""Postures to which a body comes from its front."""
_RESTS_S = 0.4
"""Seconds of a body that lies, between two rolls or before it rises."""


def rolls_between(*names: str) -> bool:
    """Return True if a body that goes through these postures rolls over."""
    pairs = pairwise(names)
    return any(one != other and _rolls(one, other) for one, other in pairs) or any(name in SIDES_DOWN for name in names)


def _rolls(begin: str, end: str) -> bool:
    over = {begin, end} <= FLAT or (end == BACK and begin in _ON_FRONT)
    return over or begin in SIDES_DOWN or (begin == BACK and end in _ON_FRONT)


def way_over_floor(
    begin: str, own: str, end: str, seconds: float, seed: int, *, halves: int = 0, side: str = ""
) -> Array:
    """Return joints (T, 22, 3) of a body that goes from a posture to another, rolls over where it has to, stays there,
    and goes on to a third; empty = standing.

    Args:
        begin, own, end: names of the postures.
        seconds: that it stays.
        seed: decides the postures.
        halves: half turns of who rolls over, at least as many as lie between the postures; 0 = these.
        side: left or right, to which it rolls; empty = the shorter way.
    """
    parts, at = list[Array](), begin
    if begin:  # it waits a moment before it moves
        parts.append(_stays(begin, BEGINS_S, seed))
    if halves and begin not in FLAT:
        at = own if halves % 2 == 0 else OPPOSITE.get(own, BACK)
        parts.append(_passes(begin, at, seed))
    for one, other, rolls in (*_steps(at, own, halves), (own, own, False), *_steps(own, end, 0)):
        if one == other and not rolls:
            parts.append(_stays(own, max(seconds, 0.1), seed))
        elif rolls:
            first, second = (_stays(each, 0.0, seed)[-1] for each in (one, other))
            parts.append(rolled_over(first, second, side, max(halves, 1)))
        else:
            parts.append(_passes(one, other, seed))
    joined = parts[0]
    for part in parts[1:]:
        joined = np.concatenate([joined, _beside(joined[-1], part)[1:]])
    return joined


def roll_over(rng: random.Random, halves: int = 1, side: str = "") -> Gesture:
    """A body that lies on its back and rolls over on the floor.

    Args:
        rng: decides everything that is not given.
        halves: half turns.
        side: left or right, to which it rolls.
    """
    seed, side = rng.randrange(2**31), side or rng.choice((LEFT, RIGHT))
    own = BACK if halves % 2 == 0 else FRONT
    joints = way_over_floor(BACK, own, own, rng.uniform(0.6, 1.2), seed, halves=halves, side=side)

    def change(body: StandingBody) -> None:
        index = np.minimum(np.arange(len(body.joints)), len(joints) - 1)
        body.joints = joints[index] + body.joints[0, 0] * LEVEL

    return Gesture(len(joints) / FPS, ("roll", "roll-over"), change, side)


def ground_pounded(rng: random.Random, hand: str = "", times: int | None = None) -> Gesture:
    """A body that goes down to its knees and beats the floor.

    Args:
        rng: decides everything that is not given.
        hand: left or right fist; empty = both.
        times: blows; None = some.
    """
    deed = LowDeed(POUNDS, hand, times)
    done = passing("", KNEES, KNEES, rng.uniform(0.6, 1.0), str(rng.randrange(2**31)), deed)
    return done.gesture(rng, ["pound-ground"])


def _steps(begin: str, end: str, halves: int) -> tuple[tuple[str, str, bool], ...]:
    """Return the parts of a way: from where, to where, and if the body rolls over in it."""
    if begin == end:
        return ((begin, end, True),) if halves else ()
    if {begin, end} <= FLAT:
        return ((begin, end, True),)
    if begin in SIDES_DOWN:
        over = BACK if end == UPRIGHT else FRONT
        return ((begin, over, True), (over, end, False))
    if begin == BACK and end in _ON_FRONT:
        return ((BACK, FRONT, True), (FRONT, end, False))
    if begin in _ON_FRONT and end == BACK:
        return ((begin, FRONT, False), (FRONT, BACK, True))
    return ((begin, end, False),)


def _stays(name: str, seconds: float, seed: int) -> Array:
    """Return joints (T, 22, 3) of a body that stays in a posture."""
    if name not in SIDES_DOWN:
        return _passed(name, name, seconds, seed)
    gesture = side_dive(random.Random(f"{seed} {name}"), LEFT if name == LEFT_SIDE else RIGHT)  # noqa: S311
    body = StandingBody(standing_still(round(gesture.seconds * FPS) + 1, random.Random(f"{seed} stands")))  # noqa: S311
    gesture.change(body)
    return body.solved()[-1:].repeat(max(round(seconds * FPS), 2), axis=0)


def _passes(begin: str, end: str, seed: int) -> Array:
    return _passed(begin, end, 0.0, seed)


def _passed(begin: str, end: str, seconds: float, seed: int) -> Array:
    """Return joints (T, 22, 3) of a body that goes from a posture to another and stays there."""
    done = passing(begin, end, end, max(seconds, 1 / FPS) if begin == end else seconds, str(seed))
    frames = max(round(done.times[-1] * FPS) + 1, 2)
    body = StandingBody(standing_still(frames, random.Random(f"{seed} stands")))  # noqa: S311
    pose(body, done.times, done.postures)
    return body.solved()


def _beside(last: Array, part: Array) -> Array:
    """Return joints (T, 22, 3) moved and turned over the floor so that the first pose is where the last one was."""
    here, there = ((each - each[0]) * LEVEL for each in (part[0], last))
    turn = np.arctan2((here[:, 2] * there[:, 0] - here[:, 0] * there[:, 2]).sum(), (here * there).sum())
    return rotate(about("Y", turn), part - part[0, 0] * LEVEL) + last[0] * LEVEL
