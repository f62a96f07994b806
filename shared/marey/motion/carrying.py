"""Feet that carry a body which none carries: of feet that all slide, the slowest one stands.

In dances, fights and runs a network lets both feet slide from one stand to the next, at half a metre a second or more.
Neither is slow enough for a contact, yet the body weighs on one of them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from marey.motion.feet import RULE, ContactRule, find_contacts, runs
from marey.motion.rotations import Array
from marey.motion.skeleton import OTHER_FOOT, Skeleton

Bool = NDArray[np.bool_]

TOUCHES_M, CARRIES_M = 0.05, 0.08
"""Metres over its standing height up to which a foot touches the floor, and up to which one of them carries the body
meanwhile."""
SLIDES = 0.3
"""Metres a second from which a foot does not stand."""
FASTEST = 1.3
"""Metres a second of a foot that is made to stand, at most; a faster one swings."""
SWING_S = 0.15
"""Seconds between two stands of a foot, at least."""
STRAYS = 0.8
"""Share of the slide of a `ContactRule` by which a foot is moved at most, so that it is no slide on purpose."""


def carrying_contacts(joints: Array, skeleton: Skeleton, fps: float, *, rule: ContactRule = RULE) -> Bool:
    """Return the contacts (T, 4) of `find_contacts`, and those of toes that slide while they carry the body.

    Args:
        joints: (T, J, 3) metres, Y up.
        skeleton: must have feet.
        fps: frames a second.
        rule: thresholds in metres and seconds.
    """
    stands, height = find_contacts(joints, skeleton, fps, rule=rule), _heights(joints, skeleton)
    toes, speed = joints[:, list(skeleton.feet[1::2])], _carrying_speed(joints, stands, height, skeleton, fps)
    swing, most = max(round(SWING_S * fps), 2), STRAYS * rule.slide
    while speed.size and speed.min() < FASTEST:
        step, side = (int(k) for k in np.unravel_index(speed.argmin(), speed.shape))
        own = stands[:, 2 * side + 1]
        grown = _grown(toes[:, side], speed[:, side], step, most)
        begin, end = _beside(grown, toes[:, side], height[:, 2 * side + 1] < CARRIES_M, own, most, swing)
        own[begin:end] = True
        speed[begin : max(end - 1, begin)] = np.inf
        speed[step, side] = np.inf
    return stands


def _heights(joints: Array, skeleton: Skeleton) -> Array:
    """Return metres (T, 4) of the joints of the feet over their standing height, the lower one of both sides."""
    height = joints[:, list(skeleton.feet), 1]
    ground = np.quantile(height, 0.1, axis=0)
    return height - np.minimum(ground, ground[OTHER_FOOT])


def _carrying_speed(joints: Array, stands: Bool, height: Array, skeleton: Skeleton, fps: float) -> Array:
    """Return metres a second (T - 1, 2) of toes from each frame to the next where they may be what carries the body,
    and no foot stands; infinity elsewhere."""
    speed = np.linalg.norm(np.diff(joints[:, list(skeleton.feet)], axis=0), axis=-1) * fps
    low, high = np.minimum(height[1:], height[:-1]), np.maximum(height[1:], height[:-1])
    stand = ((low < CARRIES_M) & (speed < SLIDES)) | (stands[1:] & stands[:-1])
    slides = (low < TOUCHES_M).any(axis=1) & ~stand.any(axis=1)
    return np.where(slides[:, None] & (high[:, 1::2] < CARRIES_M), speed[:, 1::2], np.inf)


def _grown(toe: Array, speed: Array, step: int, most: float) -> tuple[int, int]:
    """Return the frames (begin, end) of a stand that grows from a step to its slower neighbours, as far as the toe does
    not stray from its mean place.

    Args:
        toe: (T, 3) metres.
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
    """Return a stand (begin, end) that goes on in those beside it, or keeps away from them; empty if there is no room.

    Args:
        grown: frames of the stand.
        toe: (T, 3) metres.
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
    return (begin, end) if end - begin > 1 else (begin, begin)


def _stray(places: Array) -> float:
    """Return how far places (n, 3) get from their mean over the floor, metres."""
    flat = places[:, [0, 2]]
    return float(np.linalg.norm(flat - flat.mean(axis=0), axis=1).max())
