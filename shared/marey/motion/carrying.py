"""Feet that carry a body which none carries: of feet that all slide, the slowest one stands.

In dances, fights and runs a network lets both feet slide from one stand to the next, at half a metre a second or more.
Neither is slow enough for a contact, yet the body weighs on one of them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from marey.motion.courses import SWING_S
from marey.motion.feet import RULE, ContactRule, find_contacts, heights, runs
from marey.motion.rotations import Array, normalize
from marey.motion.skeleton import Skeleton

Bool = NDArray[np.bool_]

TOUCHES_M, CARRIES_M = 0.05, 0.08
"""Metres over its standing height up to which a foot touches the floor, and up to which one of them carries the body
meanwhile."""
UPRIGHT = 0.5
"""Share of the height of the root over the feet in the rest pose that it has over feet that carry it, at least."""
SLIDES = 0.3
"""Metres a second from which a foot does not stand."""
FASTEST = 1.6
"""Metres a second of a foot that is made to stand, at most; a faster one swings."""
SPREADS = 0.4
"""Metres a second of each of two feet that move apart or together in a hop."""
EVEN = 0.6
"""Share of the speed of the faster one of them that the slower one has, at least."""
SHORTEST_S = 0.15
"""Seconds of a stand, at least: shorter ones would stick and slip."""


def carrying_contacts(joints: Array, skeleton: Skeleton, fps: float, *, rule: ContactRule = RULE) -> Bool:
    """Return the contacts (T, 4) of `find_contacts`, and those of toes that slide while they carry the body.

    Args:
        joints: (T, J, 3) metres, Y up.
        skeleton: must have feet.
        fps: frames a second.
        rule: thresholds in metres and seconds.
    """
    stands, height = find_contacts(joints, skeleton, fps, rule=rule), heights(joints, skeleton)
    toes, speed = (
        joints[:, list(skeleton.feet[1::2])][..., [0, 2]],
        _carrying_speed(joints, stands, height, skeleton, fps),
    )
    swing, shortest = (max(round(seconds * fps), 2) for seconds in (SWING_S, SHORTEST_S))
    while speed.size and speed.min() < FASTEST:
        step, side = (int(k) for k in np.unravel_index(speed.argmin(), speed.shape))
        own = stands[:, 2 * side + 1]
        grown = _grown(toes[:, side], speed[:, side], step, rule.slide)
        begin, end = _beside(grown, toes[:, side], height[:, 2 * side + 1] < CARRIES_M, own, rule.slide, swing)
        if end - begin > shortest:
            own[begin:end] = True
            speed[begin : end - 1] = np.inf
        if grown[1] - grown[0] <= shortest:
            speed[grown[0] : grown[1] - 1, side] = np.inf
        speed[step, side] = np.inf
    return stands


def _carrying_speed(joints: Array, stands: Bool, height: Array, skeleton: Skeleton, fps: float) -> Array:
    """Return metres a second (T - 1, 2) of toes from each frame to the next where they may be what carries the body,
    and no foot stands; infinity elsewhere."""
    speed = np.linalg.norm(np.diff(joints[:, list(skeleton.feet)], axis=0), axis=-1) * fps
    low, high = np.minimum(height[1:], height[:-1]), np.maximum(height[1:], height[:-1])
    stand = ((low < CARRIES_M) & (speed < SLIDES)) | (stands[1:] & stands[:-1])
    slides = (low < TOUCHES_M).any(axis=1) & ~stand.any(axis=1)
    slides &= _upright(joints, skeleton)[1:] & ~_spread(joints[:, list(skeleton.feet[1::2])], fps)
    return np.where(slides[:, None] & (high[:, 1::2] < CARRIES_M), speed[:, 1::2], np.inf)


def _grown(toe: Array, speed: Array, step: int, most: float) -> tuple[int, int]:
    """Return the frames (begin, end) of a stand that grows from a step to its slower neighbours, as far as the toe does
    not stray from its mean place.

    Args:
        toe: (T, 2) metres, over the floor.
        speed: (T - 1,) metres a second from each frame to the next; infinity where the toe may not stand.
        step: that is grown from.
        most: metres that the toe strays at most.
    """
    begin, end = step, step + 2
    while True:
        before = speed[begin - 1] if begin else np.inf
        after = speed[end - 1] if end <= len(speed) else np.inf
        wider = (begin - 1, end) if before <= after else (begin, end + 1)
        if min(before, after) >= FASTEST or _stray(toe[slice(*wider)]) > most:
            return begin, end
        begin, end = wider


def _beside(grown: tuple[int, int], toe: Array, low: Bool, stands: Bool, most: float, swing: int) -> tuple[int, int]:
    """Return a stand (begin, end) that goes on in those beside it, or keeps away from them.

    Args:
        grown: frames of the stand.
        toe: (T, 2) metres, over the floor.
        low: (T,) where the toe is low enough to stand.
        stands: (T,) where it stands already.
        most: metres that the toe strays at most in a stand.
        swing: frames from one stand to the next, at least.
    """
    begin, end = grown
    for first, last in runs(stands):
        if first - end >= swing or begin - last >= swing:
            continue
        joined = min(begin, first), max(end, last)
        if low[slice(*joined)].all() and _stray(toe[slice(*joined)]) <= most:
            begin, end = joined
        elif first <= begin:
            begin = max(begin, last + swing)
        else:
            end = min(end, first - swing)
    return begin, end


def _upright(joints: Array, skeleton: Skeleton) -> Bool:
    """Return True (T,) where the root is high over the feet: who swims or crawls is not carried by them."""
    feet, rest = list(skeleton.feet), skeleton.rest[:, 1]
    return joints[:, 0, 1] - joints[:, feet, 1].min(axis=1) > UPRIGHT * (rest[0] - rest[feet].min())


def _spread(toes: Array, fps: float) -> Bool:
    """Return True (T - 1,) where both of two toes (T, 2, 3) move away from each other, or towards each other, as those
    of a body that hops: neither carries it."""
    apart = toes[:, 0] - toes[:, 1]
    line = normalize(apart[1:] + apart[:-1])[:, None]
    left, right = ((np.diff(toes, axis=0) * line).sum(axis=-1) * fps).T
    slower, faster = np.sort(np.abs([left, right]), axis=0)
    return (left * right < 0) & (slower > np.maximum(SPREADS, EVEN * faster))


def _stray(places: Array) -> float:
    """Return how far places (n, 2) get from their mean, metres."""
    off = places - places.sum(axis=0) / len(places)
    return float(np.sqrt((off * off).sum(axis=1).max()))
