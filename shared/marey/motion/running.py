"""Bodies that run: feet that carry them for a few frames, and flights in which they fall.

A network lets a running body glide: the foot that carries it slides on at a third of the body's speed, so it is no
contact by any fixed speed, and the pelvis keeps its height while both feet are in the air. Here the foot that comes
down stands while it is clearly slower than the body, and the height of the body follows from its contacts: between
two steps it rises and falls as whatever is thrown, and the leg that stands catches it and throws it on.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from marey.motion.curves import smooth_open
from marey.motion.feet import RUNNING, heights, runs
from marey.motion.filters import smooth
from marey.motion.legs import follow_feet, foot_chain
from marey.motion.rotations import Array
from marey.motion.skeleton import Skeleton

Bool = NDArray[np.bool_]

SPEED_S = 0.2
"""Standard deviation of the filter of the speed of a body, seconds."""
UPRIGHT = 0.6
"""Share of the height of the root over the feet in the rest pose that it has over those of a body that runs."""
CARRIES, GROWS = 0.45, 0.6
"""Shares of the speed of the body below which a low toe carries it, and up to which such a step goes on."""
LOW_M = 0.06
"""Metres over its standing height up to which a toe carries the body."""
REACH_S = 0.15
"""Seconds before and after a moment of a run within which a foot comes down."""
STRAYS_M = 0.12
"""Metres by which a toe strays from its mean place in a step at most: a farther one slides on purpose."""
LONGEST_S = 0.3
"""Seconds of a step that is found here at most."""
FLIGHT_S = 0.36
"""Seconds of a flight of a run at most; a longer one is a leap."""
GRAVITY = 9.81
TAKES_OFF = 0.15
"""Share of a flight's first and last frame in which a foot still carries the body."""
STAYS, EVEN = 0.06, 0.15
"""Weights of the height that the body has, and of an even force of the leg that carries it, beside that of a fall."""
MOST_M = 0.08
"""Metres by which the body is higher or lower than before at most."""
BESIDE = 4
"""Frames beside a run in which its height passes into that of the body before and after it."""


def running_frames(joints: Array, skeleton: Skeleton, fps: float) -> Bool:
    """Return the frames (T,) in which a body (T, J, 3) goes upright at the speed of a run."""
    if len(joints) < 3:
        return np.zeros(len(joints), bool)
    feet, rest = list(skeleton.feet), skeleton.rest[:, 1]
    upright = joints[:, 0, 1] - joints[:, feet, 1].min(axis=1) > UPRIGHT * (rest[0] - rest[feet].min())
    return upright & (_speed(joints, fps) > RUNNING)


def on_its_steps(joints: Array, going: Bool, skeleton: Skeleton, fps: float) -> Array:
    """Return joints (T, J, 3) of a body that comes down to the floor in each step of its run. All joints of a frame are
    lowered alike, so the body runs in the same frames.

    Args:
        joints: (T, J, 3) metres, Y up.
        going: (T,) `running_frames`.
        skeleton: must have feet.
        fps: frames a second.
    """
    if not going.any():
        return joints
    reach = round(REACH_S * fps)
    lowest = heights(joints, skeleton)[:, 1::2].min(axis=1)
    near = np.lib.stride_tricks.sliding_window_view(np.pad(lowest, reach, mode="edge"), 2 * reach + 1).min(axis=1)
    drift = smooth((np.maximum(near, 0.0) * going)[:, None], 0.5 * reach)
    return joints - drift[..., None] * np.array([0.0, 1.0, 0.0])


def with_running_steps(joints: Array, contacts: Bool, going: Bool, skeleton: Skeleton, fps: float) -> Bool:
    """Return contacts (T, 4) with the steps of a run: of two feet, the toe that comes down and is clearly slower than
    the body.

    Args:
        joints: (T, J, 3) metres, Y up.
        contacts: (T, 4) that are known; they are kept.
        going: (T,) `running_frames`.
        skeleton: must have feet.
        fps: frames a second.
    """
    contacts = contacts.copy()
    if not going.any():
        return contacts
    feet = list(skeleton.feet)
    height = heights(joints, skeleton)
    steps = np.gradient(joints[:, feet[1::2]][..., [0, 2]], axis=0)
    share = np.linalg.norm(steps, axis=-1) * fps / np.maximum(_speed(joints, fps), RUNNING)[:, None]
    low = going[:, None] & (height[:, 1::2] < LOW_M)
    low &= height[:, 1::2] <= height[:, 1::2][:, ::-1] + LOW_M
    for side in range(2):
        toe = joints[:, feet[2 * side + 1]][:, [0, 2]]
        for begin, end in runs(low[:, side] & (share[:, side] < GROWS)):
            if share[begin:end, side].min() < CARRIES:
                begin, end = _slowest(toe, share[:, side], (begin, end), round(LONGEST_S * fps))
                others = contacts[begin:end, 2 - 2 * side : 4 - 2 * side].any(axis=1)
                if end - begin > 1:
                    contacts[begin:end, 2 * side + 1] |= ~others
    return contacts


def _slowest(toe: Array, share: Array, step: tuple[int, int], most: int) -> tuple[int, int]:
    """Return the frames (begin, end) of a step without those at its ends in which the toe moves fastest, until it
    hardly strays from its mean place."""
    begin, end = step
    while end - begin > 1:
        off = np.linalg.norm(toe[begin:end] - toe[begin:end].mean(axis=0), axis=1).max()
        if off <= STRAYS_M and end - begin <= most:
            break
        begin, end = (begin + 1, end) if share[begin] > share[end - 1] else (begin, end - 1)
    return begin, end


def with_flights(joints: Array, contacts: Bool, going: Bool, skeleton: Skeleton, fps: float) -> Array:
    """Return joints (T, J, 3) of a body that falls where it runs and no foot carries it.

    Args:
        joints: (T, J, 3) metres, Y up.
        contacts: (T, 4) of its feet.
        going: (T,) `running_frames`.
        skeleton: must have feet, hips and legs.
        fps: frames a second.
    """
    flies = _flights(contacts, going, fps)
    if not flies.any():
        return joints
    moved, change = joints.copy(), np.zeros(len(joints))
    near = np.convolve(flies, np.ones(2 * round(FLIGHT_S * fps) + 1), "same") > 0.5
    for begin, end in runs(np.asarray(near, bool)):
        begin, end = max(begin - BESIDE, 0), min(end + BESIDE, len(joints))
        change[begin:end] = _falling(joints[begin:end, 0, 1], flies[begin:end], (begin == 0, end == len(joints)), fps)
    carries = contacts[:, 1::2] | contacts[:, ::2]
    for side in range(2):
        stands = np.where(carries[:, side], 0.0, change)
        for joint in foot_chain(skeleton, skeleton.feet[2 * side + 1]):
            moved[:, joint, 1] += stands
    feet = {joint for toe in skeleton.feet[1::2] for joint in foot_chain(skeleton, toe)}
    moved[:, [joint for joint in range(len(skeleton)) if joint not in feet], 1] += change[:, None]
    before = joints.copy()
    before[..., 1] += change[:, None]
    follow_feet(before, moved, carries, skeleton, fps)
    return moved


def _flights(contacts: Bool, going: Bool, fps: float) -> Bool:
    """Return the frames (T,) of the short flights of a run; those at the ends of the clip are none."""
    flies = np.zeros(len(going), bool)
    for begin, end in runs(np.asarray(~contacts.any(axis=1))):
        inside = begin > 0 and end < len(going)
        flies[begin:end] = inside and going[begin:end].all() and end - begin <= FLIGHT_S * fps
    return flies


def _falling(height: Array, flies: Bool, ends: tuple[bool, bool], fps: float) -> Array:
    """Return by how many metres (T,) a body of some height (T,) is moved to fall in its flights.

    Args:
        height: (T,) of the root.
        flies: (T,).
        ends: the first frame is that of the clip, and the last.
    """
    count = len(height)
    second, third = (np.diff(np.eye(count), order, axis=0) for order in (2, 3))
    edges = flies[1:-1] & ~(flies[:-2] & flies[2:])
    alone = flies[1:-1] & ~flies[:-2] & ~flies[2:]
    falls = -GRAVITY / fps**2 * (1.0 - TAKES_OFF * edges - TAKES_OFF * alone)
    fall_weight = flies[1:-1].astype(float)
    stay = np.full(count, STAYS)
    stay[:1], stay[-1:] = (STAYS if ends[0] else 100.0), (STAYS if ends[1] else 100.0)
    falling = fall_weight[:, None] * second
    # Normal equations: every height has a weight, so they are regular; least squares would take five times as long.
    system = falling.T @ falling + np.diag(stay**2) + EVEN**2 * third.T @ third
    made = np.linalg.solve(system, falling.T @ (fall_weight * falls) + stay**2 * height)
    return np.clip(made - height, -MOST_M, MOST_M)


def _speed(joints: Array, fps: float) -> Array:
    way = smooth_open(joints[:, 0, [0, 2]], SPEED_S * fps)
    return np.linalg.norm(np.gradient(way, axis=0), axis=-1) * fps
