"""Dribbles, kicks of a ball and throws, drawn on the body that a network made.

Of a kick a network knows the run-up, of a dribble the stance, and its throws let go beside the head or not at all. A
hand dribbles on the motion as it is; a leg swings through the place of a ball, and an arm throws, on a body that stands
as in the calmest second of the motion.
"""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from marey.generation.calm import calm
from marey.generation.fine_wish import FineWish
from marey.motion.filters import smooth_seconds
from marey.posing.standing import ARMS, LEFT, LEGS, OTHER_SIDE, RIGHT, SIGN, StandingBody, eased, way_through

Array = NDArray[np.floating]
Point = tuple[float, float, float]

_DRIBBLE_HZ, _STROKE = (1.5, 1.9), 0.24
_BALL: Point = (0.10, 0.08, 0.32)
"""Place of the wrist in the middle of its stroke: outward, up and forward of the hips, metres."""
SPARE_S = 0.4
"""Seconds beside a kick or a throw, at least."""
KICK_S = (0.34, 0.13, 0.13, 0.65)
"""Seconds in which the leg of a ball's kick goes back, comes through the ball, follows through, and steps down."""
KICK_WAY = ((0.0, 0.0, 0.0), (0.02, 0.32, -0.44), (0.0, 0.06, 0.16), (-0.04, 0.40, 0.60), (0.0, 0.0, 0.0))
"""Places of the ankle meanwhile: outward, up and forward of where it stands, metres."""
_RUNS_UP = re.compile(r"\b(?:run|ran|jog|sprint|approach|step|charg|walk|dribbl)")
"""Words of what comes before a kick of a ball."""
THROW_S = (0.5, 0.12, 0.14, 0.2, 0.75)
"""Seconds in which the hand of a throw goes back, stays there, comes ahead, follows through and comes down."""
THROW_WAY: tuple[Point, ...] = (
    (0.12, -0.40, 0.12), (0.26, 0.16, -0.20), (0.24, 0.20, -0.24),
    (0.0, 0.14, 0.46), (-0.16, -0.30, 0.34), (0.12, -0.40, 0.12),
)  # fmt: skip
"""Places of the hand at these times: outward, up and forward of the shoulder, metres."""
THROW_TWIST, THROW_TRUNK = (0.0, 34.0, 36.0, -24.0, -36.0, 0.0), (0.0, -8.0, -10.0, 12.0, 24.0, 0.0)
"""Degrees of the trunk at these times: towards the hand that throws, and forward."""


_MOVES = re.compile(
    r"\b(?:walk|jog|run|mov|advanc|dash|charg|circl|past|around|toward|forward|backward|cross|turn|spin|fak|juk|step"
    r"|(?:up|down|along|across) (?:the )?court)"
)
"""Words of feet that move with the ball."""


def dribbles_on_spot(wish: FineWish) -> bool:
    """Return True if the feet of who dribbles stay where they are."""
    return not _MOVES.search(wish.prompt.lower())


def dribbled(joints: Array, fps: float, wish: FineWish, rng: np.random.Generator) -> Array:
    """Return joints (T, 22, 3) of a body whose hand goes up and down with a ball; the other arm stays."""
    side = wish.side or str(rng.choice([LEFT, RIGHT, RIGHT]))
    body, time = StandingBody(joints), np.arange(len(joints)) / fps
    body.shift(np.full(len(joints), -0.05))
    body.bow(np.full(len(joints), 14.0), arms_hang=0.9, head=-0.3)
    phase = 2 * np.pi * (rng.uniform(*_DRIBBLE_HZ) * time + rng.uniform(0.0, 1.0))
    place = np.tile(_BALL, (len(joints), 1))
    place[:, 1] += 0.5 * _STROKE * np.cos(phase)
    hips = body.joints[:, 0]
    target = body.from_shoulder(side, hips) + place
    body.move_arm(side, np.ones(len(joints)), *body.reach(side, target, (0.8, -0.6, -0.6)), lag=0.0, straight=True)
    other = OTHER_SIDE[side]
    guard = body.from_shoulder(other, hips) + np.array([0.16, 0.16, 0.26])
    body.move_arm(other, np.full(len(joints), 0.8), *body.reach(other, guard), lag=0.0, straight=True)
    return body.solved()


def _begun(
    joints: Array,
    fps: float,
    wish: FineWish,
    rng: np.random.Generator,
    parts: tuple[float, ...],
    early: tuple[float, float],
) -> tuple[str, StandingBody, Array, Array] | None:
    """Return the side that acts, a body that stands, the time of its frames and when each part of its movement begins
    and the last one ends; None if there is no time for it.

    Args:
        parts: seconds of each part.
        early: range of the share of the other seconds that comes before.
    """
    left = len(joints) / fps - sum(parts)
    if left < SPARE_S:
        return None
    side = wish.side or str(rng.choice([LEFT, RIGHT, RIGHT, RIGHT]))
    start = float(rng.uniform(*early)) * left
    times = start + np.concatenate([[0.0], np.cumsum(parts)])
    return side, StandingBody(calm(joints, fps, rng)), np.arange(len(joints)) / fps, times


def kicks_well(joints: Array, fps: float, wish: FineWish) -> bool:
    """Return True if a run-up is asked for, which is not drawn."""
    del joints, fps
    return bool(_RUNS_UP.search(wish.prompt.lower()))


def kicked_ball(joints: Array, fps: float, wish: FineWish, rng: np.random.Generator) -> Array | None:
    """Return joints (T, 22, 3) of a body that stands and kicks a ball; None if there is no time for it."""
    begun = _begun(joints, fps, wish, rng, KICK_S, (0.2, 0.45))
    if begun is None:
        return None
    side, body, time, times = begun
    place = smooth_seconds(way_through(time, times, KICK_WAY), 0.035, fps)
    turns = times[[0, 1, 3, 4]]  # it begins, is wound up, has struck, has ended
    trunk = way_through(time, turns, (0.0, 12.0, -10.0, 0.0))
    swing = way_through(time, turns, (0.0, -1.0, 1.0, 0.0))
    on = _on(time, times)
    body.shift(-0.04 * on, left=-0.06 * SIGN[side] * on)
    body.lean(smooth_seconds(trunk, 0.05, fps), "left")
    body.lean(smooth_seconds(SIGN[side] * 14.0 * swing, 0.05, fps), "up")
    _, _, ankle, toe = LEGS[side]
    body.joints[:, [ankle, toe]] += body.world(place, side)[:, None]
    other = OTHER_SIDE[side]
    for arm, way in ((other, swing), (side, -swing)):
        body.turn(ARMS[arm][1], "left", smooth_seconds(-38.0 * way, 0.06, fps))
        body.lift_arm(arm, 22.0 * on)
    return body.solved()


def thrown(joints: Array, fps: float, wish: FineWish, rng: np.random.Generator) -> Array | None:
    """Return joints (T, 22, 3) of a body that stands and throws; None if there is no time for it."""
    begun = _begun(joints, fps, wish, rng, THROW_S, (0.25, 0.5))
    if begun is None:
        return None
    side, body, time, times = begun
    twist, trunk = (smooth_seconds(way_through(time, times, each), 0.04, fps) for each in (THROW_TWIST, THROW_TRUNK))
    body.lean(SIGN[side] * twist, "up")
    body.lean(trunk, "left")
    body.shift(-0.03 * _on(time, times), forward=0.002 * trunk)
    place = smooth_seconds(way_through(time, times, THROW_WAY), 0.025, fps)
    way = eased((time - times[0] + 0.4) / 0.4) * (1 - eased((time - times[-1]) / 0.4))
    body.move_arm(side, way, *body.reach(side, place, (0.9, -0.2, -0.4)), lag=0.0, straight=True)
    ahead = np.array([0.08, -0.06, 0.42]) + _after(time, times)[:, None] * np.array([0.14, -0.30, -0.34])
    body.move_arm(OTHER_SIDE[side], 0.85 * way, *body.reach(OTHER_SIDE[side], ahead), lag=0.0)
    return body.solved()


def _after(time: Array, times: Array) -> Array:
    """Return 0 to 1 (T,): how far a throw is past its turn."""
    return eased((time - times[2]) / 0.6)


def _on(time: Array, times: Array) -> Array:
    """Return how much of a kick there is, 0 to 1 (T,)."""
    return eased((time - times[0]) / 0.3) * (1 - eased((time - times[3]) / (times[4] - times[3])))
