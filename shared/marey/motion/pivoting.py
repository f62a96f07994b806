"""Feet that turn on the floor: on the ball, with the heel up.

Kicks and spins are made with a foot that turns flat on the floor, or about its heel, so that its toes sweep over it. A
body whose other foot is in the air turns on the ball of the foot that carries it: the toes stay where they are, the
heel comes up and goes around them, and the body goes with it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from marey.motion.feet import heights, runs
from marey.motion.filters import smooth
from marey.motion.legs import foot_chain
from marey.motion.rotations import Array, length
from marey.motion.skeleton import Skeleton

Bool = NDArray[np.bool_]

TURNS, LEAST = 90.0, 40.0
"""Degrees a second from which on a foot turns on the floor, and degrees of a turn that is looked at."""
LEAST_S, SWEEPS = 0.1, 3.0
"""Seconds of a turn at least, and metres a second of its toe at most: one that turns faster swings."""
LOW_M = 0.05
"""Metres over their standing height up to which a heel and a toe are on the floor."""
GAP_S = 0.15
"""Seconds between two turns, one way and back, in which the heel stays up."""
HEEL, STEEPEST = 22.0, 50.0
"""Degrees by which the heel is lifted about the toes, and of the foot over the floor at most."""
RISES_S = 0.07
"""Standard deviation of the filter with which the heel comes up and goes down, seconds."""
EASES_S = 0.06
"""The same of the filter with which the body begins to go along with the foot."""
ALONE = 0.6
"""Share of the frames of a turn in which the other foot is in the air, at least."""


def on_balls(joints: Array, skeleton: Skeleton, fps: float) -> Array:
    """Return joints (T, J, 3) of a body that turns on the ball of the foot that carries it alone.

    Args:
        joints: (T, J, 3) metres, Y up.
        skeleton: must have feet.
        fps: frames a second.
    """
    for side in range(2):
        for begin, end in _turns(joints, skeleton, fps, side):
            joints = _turned(joints, skeleton, fps, side, (begin, end))
    return joints


def _turns(joints: Array, skeleton: Skeleton, fps: float, side: int) -> list[tuple[int, int]]:
    """Return the first frame of each turn of a flat foot that carries the body alone, and the one after its last."""
    if len(joints) < 3:
        return []
    ankle, toe = (joints[:, j] for j in skeleton.feet[2 * side : 2 * side + 2])
    yaw = np.unwrap(np.arctan2(*(toe - ankle)[:, [0, 2]].T))
    low = heights(joints, skeleton) < LOW_M
    own = np.asarray(low[:, 2 * side : 2 * side + 2].all(axis=1), bool)
    other = np.asarray(low[:, 2 * (1 - side) : 4 - 2 * side].any(axis=1), bool)
    fast = own & (np.abs(np.gradient(yaw)) * fps > np.radians(TURNS))
    for begin, end in runs(own & ~fast):
        fast[begin:end] |= (
            begin > 0 and end < len(fast) and end - begin <= GAP_S * fps and fast[begin - 1] and fast[end]
        )
    steps = np.abs(np.diff(yaw, append=yaw[-1]))
    speed = length(np.gradient(toe, axis=0)) * fps
    return [
        (begin, end)
        for begin, end in runs(fast)
        if np.degrees(steps[begin:end].sum()) > LEAST
        and 1.0 - float(np.mean(other[begin:end])) >= ALONE
        and end - begin >= LEAST_S * fps
        and speed[begin:end].max() < SWEEPS
    ]


def _turned(joints: Array, skeleton: Skeleton, fps: float, side: int, turn: tuple[int, int]) -> Array:
    """Return joints (T, J, 3) of a body that makes one turn on the ball of a foot."""
    begin, end = turn
    toe = skeleton.feet[2 * side + 1]
    ball, foot = joints[:, toe], [j for j in foot_chain(skeleton, toe) if j != toe]
    on_floor = np.zeros((len(joints), 1))
    on_floor[begin:end] = 1.0
    lifted = smooth(on_floor, RISES_S * fps)[:, 0]
    moved, ankle = joints.copy(), joints[:, foot[-1]]
    stays = np.zeros_like(ball)
    stays[begin:end] = ball[begin] - ball[begin:end]
    stays[end:] = ball[begin] - ball[end - 1]
    stays[:, 1] = 0.0
    stays = smooth(stays, EASES_S * fps)  # the body does not begin and end to go along at once
    sole = ankle - ball
    far, flat = length(sole), np.maximum(length(sole[:, [0, 2]]), 1e-6)
    steep = np.arcsin(np.clip(sole[:, 1] / np.maximum(far, 1e-6), -1.0, 1.0))
    steeper = np.clip(steep + np.radians(HEEL) * lifted, steep, np.maximum(steep, np.radians(STEEPEST)))
    raised = sole * (far * np.cos(steeper) / flat)[:, None]
    raised[:, 1] = far * np.sin(steeper)
    shift = stays + np.where((lifted > 1e-3)[:, None], raised - sole, 0.0)
    moved += shift[:, None]
    moved[:, toe] = ball + stays
    return moved
