"""Search for cycles: two frames with nearly the same pose and movement, a whole number of gait cycles apart."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from marey.core.errors import InvalidInput
from marey.motion.clip import MotionClip
from marey.motion.edits.loop_feet import on_the_spot, onsets, supports
from marey.motion.kinematics import facing
from marey.motion.rotations import Array

Bool = NDArray[np.bool_]

SHORTEST_STILL = 2.0
"""Seconds of the shortest cycle without steps."""
SHORTEST_GAIT, LONGEST = 0.4, 10.0
"""Seconds of a cycle with steps, and of any."""
LONGEST_SOURCE = 3000
"""Frames of a motion that is searched: all pairs of them are compared."""
TRAVELS = 0.25
"""Metres a second from which on a motion with steps is locomotion."""
STEADY = 0.75
"""Share of the source's mean speed that a cycle of locomotion has at least: its first and last steps are slower."""
STRAIGHT = 0.1
"""Metres of cost a radian that a cycle turns more or less than its source in the same time."""
AHEAD = 0.1
"""Seconds that a velocity counts for beside a place."""
HASTE = 0.3
"""Metres of cost for a beginning at which a joint moves twice as far as in `PERCENTILE` percent of the frames: a seam
there would miss the bars."""
PERCENTILE = 95.0
"""Of the steps of a joint in the source: the largest step at a seam."""
NEIGHBOURS = 1
"""Frames within which only the best of two beginnings or ends is tried at first."""


@dataclass(frozen=True)
class Cycle:
    """A candidate: the pose of frame `last` is nearly that of frame `first`.

    Attributes:
        first, last: frames of the source.
        cost: mean distance of the joints and of their movement, metres.
    """

    first: int
    last: int
    cost: float


def has_steps(clip: MotionClip, contacts: Bool) -> bool:
    """Return True for locomotion: both feet step, and the body travels, or its feet slide back under it."""
    steps = onsets(_supports(clip, contacts)).sum(axis=0)
    moves = _way(clip)[-1] / clip.seconds > TRAVELS or on_the_spot(clip.joints, contacts, clip.skeleton).any()
    return bool(steps.min() >= 1 and moves)


def _supports(clip: MotionClip, contacts: Bool) -> Bool:
    return supports(clip.joints, contacts, clip.skeleton, clip.fps)


def cycles(clip: MotionClip, contacts: Bool, window: int, most: int, neighbours: int = NEIGHBOURS) -> Iterator[Cycle]:
    """Yield at most `most` candidates, the nearest first, none of them a neighbour of one before.

    Args:
        clip: with known hips and shoulders.
        contacts: (T, 4).
        window: frames of the blend; poses are compared over it.
        neighbours: frames within which another one is a neighbour; 0 = none is.

    Raises:
        InvalidInput: the motion is too long, or too short for any cycle.
    """
    if clip.frames > LONGEST_SOURCE:
        raise InvalidInput(
            f"{clip.frames} frames are too many to search; the most is {LONGEST_SOURCE}", hint="Trim the motion first."
        )
    steps = has_steps(clip, contacts)
    cost = _distances(clip, window) + STRAIGHT * _extra_turn(clip) + HASTE * _haste(clip)[:, None]
    allowed = _lengths(clip, SHORTEST_GAIT if steps else SHORTEST_STILL)
    if steps:
        allowed &= _whole_gaits(_supports(clip, contacts), window) & _travelling(clip)
    cost = np.where(allowed, cost, np.inf)
    for _ in range(most):
        first, last = np.unravel_index(int(cost.argmin()), cost.shape)
        if not np.isfinite(cost[first, last]):
            return
        yield Cycle(int(first), int(last), float(cost[first, last]))
        near = slice(max(first - neighbours, 0), first + neighbours + 1)
        cost[near, max(last - neighbours, 0) : last + neighbours + 1] = np.inf


def _lengths(clip: MotionClip, shortest: float) -> Bool:
    """Return the pairs (T, T) of first and last frames whose distance in time is allowed."""
    frames = np.arange(clip.frames)
    seconds = (frames[None, :] - frames[:, None]) / clip.fps
    return (seconds >= shortest - 1e-6) & (seconds <= LONGEST)


def _way(clip: MotionClip) -> Array:
    """Return the length of the root's path on the floor up to each frame (T,), metres."""
    steps = np.linalg.norm(np.diff(clip.root[:, [0, 2]].astype(np.float64), axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(steps)])


def _travelling(clip: MotionClip) -> Bool:
    """Return the pairs (T, T) between which the body is not much slower than in all."""
    way, frames = _way(clip), np.arange(clip.frames)
    mean = way[-1] / max(clip.frames - 1, 1)
    return way[None, :] - way[:, None] >= STEADY * mean * (frames[None, :] - frames[:, None])


def _extra_turn(clip: MotionClip) -> Array:
    """Return by how much the body turns more or less between two frames (T, T) than on average: radians, 0 or more."""
    x, _, z = facing(clip.joints.astype(np.float64), clip.skeleton).T
    angles = np.unwrap(np.arctan2(x, z))
    time = np.arange(clip.frames) - (clip.frames - 1) / 2
    even = angles - time * float(time @ angles) / max(float(time @ time), 1.0)
    return np.abs(even[None, :] - even[:, None])


def _haste(clip: MotionClip) -> Array:
    """Return by how much the fastest joint exceeds its usual step, or change of step, at each frame (T,): 0 or more, as
    a share."""
    joints = clip.joints.astype(np.float64)
    step, change = (np.linalg.norm(np.diff(joints, number, axis=0), axis=-1) for number in (1, 2))
    excess = np.zeros(clip.frames)
    for values, places in ((step, (slice(1, None), slice(0, -1))), (change, (slice(1, -1),))):
        usual = np.percentile(values, PERCENTILE, axis=0)
        ratio = (values / np.maximum(usual, 1e-5)).max(axis=1) - 1.0
        for place in places:
            excess[place] = np.maximum(excess[place], ratio)
    return excess


def _whole_gaits(feet: Bool, window: int) -> Bool:
    """Return the pairs (T, T) between which both feet (T, 2) step equally often, and at which the same feet carry; and
    between which both step wherever in the `window` frames before the seam will be."""
    counts = np.cumsum(onsets(feet), axis=0)
    steps = counts[None, :] - counts[:, None]
    both = (steps >= 1).all(axis=2)
    whole = both & (steps[..., 0] == steps[..., 1]) & (feet[None, :] == feet[:, None]).all(axis=2)
    for earlier in range(1, window + 1):
        whole[earlier:, earlier:] &= both[:-earlier, :-earlier]
    return whole


def _distances(clip: MotionClip, window: int) -> Array:
    """Return the mean distance (T, T) of poses and movements, each seen from its own place and heading, averaged over
    the frames of a blend before the pair."""
    poses = _seen(clip)
    square = (poses**2).sum(axis=1)
    apart = np.sqrt(np.maximum(square[:, None] + square[None, :] - 2 * poses @ poses.T, 0.0) / len(clip.skeleton))
    total, number = apart.copy(), np.ones_like(apart)
    for back in range(1, window + 1):
        total[back:, back:] += apart[:-back, :-back]
        number[back:, back:] += 1
    return 0.5 * (apart + total / number)


def _seen(clip: MotionClip) -> Array:
    """Return joints and their movement in `AHEAD` seconds (T, 6 J), from the place of the root on the floor and the
    heading of the body."""
    joints = clip.joints.astype(np.float64)
    ahead = facing(joints, clip.skeleton)
    place = clip.root.astype(np.float64) * np.array([1.0, 0.0, 1.0])
    velocity = np.gradient(joints, axis=0) * clip.fps * AHEAD
    cos, sin = ahead[:, 2, None], ahead[:, 0, None]

    def turned(vectors: Array) -> Array:
        x, y, z = vectors[..., 0], vectors[..., 1], vectors[..., 2]
        return np.concatenate([cos * x - sin * z, y, sin * x + cos * z], axis=1)

    return np.concatenate([turned(joints - place[:, None]), turned(velocity)], axis=1)
