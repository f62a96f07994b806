"""Timing: which moment of a generated motion each frame of the finished clip shows, so that steps fit the speed asked
for.

The play rate changes by at most a third, the beginning and the end may be cut, and a motion may go on at another moment
with the same pose, as in motion graphs (Kovar, Gleicher and Pighin 2002): a jog of two seconds fills four. The cheapest
course is found by dynamic programming.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from marey.motion.curves import smooth_open
from marey.motion.filters import smooth
from marey.motion.kinematics import facing
from marey.motion.rotations import Array, about, rotate
from marey.motion.skeleton import Skeleton

UNIT = 10
"""Moments a frame between which the search chooses."""
STEPS = np.arange(7, 14)
"""Play rates, in moments a frame."""
STILL = 0.4
"""Metres a second that are added to both speeds: under it they hardly differ."""
CUT = 0.03
"""Cost of a frame that is not shown, beside a frame at speeds that differ by a factor of e."""
STEADY = 1.0
"""Weight of the play rate's own logarithm beside that of the speeds' ratio: a play rate costs less jerk in the legs
than longer steps."""
SMOOTH_S = 0.2
JUMP, JUMP_PER_METRE = 0.6, 20.0
"""Cost of going on at another moment: of each, and by the mean distance of joints."""
LIKE = 0.08
"""Metres up to which two moments have the same pose."""
WAYS = 4
"""Moments at which a motion can go on from one, at most."""
NEAREST_S = 0.6
"""Seconds between two such moments, at least: a cycle of steps is longer."""
TRAVELS = 0.6
"""Metres a second that a motion travels at both: other actions are not repeated."""


@dataclass(frozen=True, eq=False)
class Jumps:
    """Frames after which a motion can go on at another: (n,) before and after, and (n,) cost."""

    before: NDArray[np.intp] = field(repr=False)
    after: NDArray[np.intp] = field(repr=False)
    cost: Array = field(repr=False)


NO_JUMPS = Jumps(np.zeros(0, np.intp), np.zeros(0, np.intp), np.zeros(0))


@dataclass(frozen=True, eq=False)
class Timing:
    """Moments that frames show.

    Attributes:
        times: (T,) in frames of the motion.
        begins: frames at which the motion goes on at another moment.
        cost: how badly speeds fit, a frame, 0 or more.
    """

    times: Array = field(repr=False)
    begins: tuple[int, ...]
    cost: float

    @property
    def pieces(self) -> list[slice]:
        """Return the frames of each piece that is played on."""
        edges = [0, *self.begins, len(self.times)]
        return [slice(begin, end) for begin, end in pairwise(edges)]


def find_jumps(joints: Array, speeds: Array, skeleton: Skeleton, fps: float) -> Jumps:
    """Return where a motion (T, J, 3) with speeds (T,) in m/s has the same pose, moving the same way, at two moments of
    its travel."""
    if (speeds > TRAVELS).sum() < NEAREST_S * fps:
        return NO_JUMPS
    ahead = smooth(facing(joints, skeleton), 0.2 * fps)
    turned = rotate(about("Y", -np.arctan2(ahead[:, 0], ahead[:, 2]))[:, None], joints - joints[:, :1] * [1, 0, 1])
    speed = np.gradient(turned, axis=0) * fps if len(joints) > 1 else np.zeros_like(turned)
    poses = np.concatenate([turned, 0.1 * speed], axis=-1)
    apart = np.stack([np.linalg.norm(poses - pose, axis=-1).mean(axis=1) for pose in poses])
    apart[speeds <= TRAVELS], apart[:, speeds <= TRAVELS] = np.inf, np.inf
    frames = np.arange(len(joints))
    apart[np.abs(frames[:, None] - frames) < NEAREST_S * fps] = np.inf
    before, after, cost = list[int](), list[int](), list[float]()
    for frame in range(len(joints) - 1):
        for there in np.argsort(apart[frame + 1], kind="stable")[:WAYS]:
            if apart[frame + 1, there] < LIKE:
                before.append(frame)
                after.append(int(there))
                skipped = CUT * max(int(there) - frame, 0)
                cost.append(JUMP + JUMP_PER_METRE * float(apart[frame + 1, there]) + skipped)
    return Jumps(np.array(before, np.intp), np.array(after, np.intp), np.array(cost))


def shortest(frames: int) -> int:
    """Return the fewest frames of a motion that can be played over `frames`."""
    return int(np.ceil((frames - 1) * STEPS[0] / UNIT)) + 2


def play_times(natural: Array, asked: Array, weight: Array, fps: float, jumps: Jumps) -> Timing:
    """Return the moments to show.

    Args:
        natural: (N,) speeds of the motion, m/s.
        asked: (T,) speeds asked for, m/s.
        weight: (T,) 1 where a speed is asked for, else 0.
        fps: of both.
        jumps: where the motion may go on.
    """
    count, moments = len(asked), (len(natural) - 1) * UNIT + 1
    if not weight.any() and len(natural) == count:
        return Timing(np.arange(count, dtype=np.float64), (), 0.0)
    at = np.linspace(0, len(natural) - 1, moments)
    own = np.log(np.interp(at, np.arange(len(natural)), natural) + STILL)
    wanted, rates = np.log(asked + STILL), np.log(STEPS / UNIT)
    cut = CUT * at
    best, came = cut.copy(), np.full((count, moments), -1, np.int32)
    for frame in range(1, count):
        arrived = np.full((len(STEPS), moments), np.inf)
        for k, step in enumerate(STEPS):
            error = wanted[frame] - own[:-step] - rates[k]
            arrived[k, step:] = best[:-step] + weight[frame] * error**2 + STEADY * rates[k] ** 2
        taken = arrived.argmin(axis=0)
        came[frame] = np.arange(moments) - STEPS[taken]
        before, best = best, arrived.min(axis=0)
        if len(jumps.before):
            _jump(before, best, came[frame], jumps, weight[frame] * (wanted[frame] - own[jumps.after * UNIT]) ** 2)
    best = best + cut[::-1]
    place = int(best.argmin())
    cost = float(best[place] / max(count - 1, 1))
    places = np.empty(count, np.intp)
    for frame in range(count - 1, -1, -1):
        places[frame] = place
        place = int(came[frame, place])
    steps = np.diff(places)
    begins = tuple(int(k) + 1 for k in np.flatnonzero((steps < STEPS[0]) | (steps > STEPS[-1])))
    return Timing(_smoothed(places / UNIT, begins, fps, len(natural) - 1), begins, cost)


def _jump(before: Array, best: Array, came: NDArray[np.int32], jumps: Jumps, error: Array) -> None:
    """Let jumps arrive at moments where they are cheaper, in place."""
    cost = before[jumps.before * UNIT] + jumps.cost + error
    for k in np.argsort(-cost, kind="stable"):
        there = jumps.after[k] * UNIT
        if cost[k] < best[there]:
            best[there], came[there] = cost[k], jumps.before[k] * UNIT


def _smoothed(times: Array, begins: tuple[int, ...], fps: float, last: float) -> Array:
    pieces = np.split(times, begins)
    smoothed = [smooth_open(piece[:, None], SMOOTH_S * fps)[:, 0] for piece in pieces]
    return np.clip(np.concatenate([np.maximum.accumulate(piece) for piece in smoothed]), 0, last)
