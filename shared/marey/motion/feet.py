"""Foot contacts and foot locking.

Generated feet slide a little while they stand, and sink into the floor or float. `clean_feet` gives each stretch in
which a toe stands one place (lock); the displacement is spread over the swings before and after it by Hermite curves,
which are continuous in value and speed at both ends (blend). The legs follow by closed-form two-bone inverse kinematics
(`legs.py`).

Locking and blending follow MoMask (EricGuo5513/momask-codes, visualization/remove_fs.py, MIT, after Holden's write-up);
thresholds here are in metres and seconds, so they hold at any frame rate.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from marey.core.errors import InvalidInput
from marey.motion.legs import follow_feet, foot_chain
from marey.motion.rotations import Array, normalize
from marey.motion.skeleton import HUMANML3D, OTHER_FOOT, Skeleton
from marey.motion.support import clearance

Bool = NDArray[np.bool_]


@dataclass(frozen=True)
class ContactRule:
    """Thresholds for foot contact in metres and seconds; heights are relative to the joint's own standing height."""

    enter_speed: float = 0.30
    leave_speed: float = 0.60
    toe_height: float = 0.04
    ankle_height: float = 0.05
    shortest: float = 0.10  # a shorter stand is ignored
    gap: float = 0.10  # a shorter lift is ignored
    slide: float = 0.15  # a foot that moves farther within one stand slides on purpose


RULE = ContactRule()
RUNNING = 1.8
"""Metres a second from which on a body runs: its feet stand for a fifth of a second, and the frames before and after
those, in which they move, lie close."""
_ENTER, _LEAVE = 0.2, 0.4
"""Shares of the speed of a running body below which a foot begins to stand, and stands."""
LONG_SWING = 0.8  # seconds; in a longer swing the correction returns to zero in between
RELEASE = 0.35  # seconds of that return
FLOOR_BAND = (0.0, 0.03)  # metres: a toe joint is inside the foot, so it stands at up to 3 cm
PRESS = 0.002  # metres that a foot may sink, so that it meets the floor without a jerk
AIR = 0.5  # metres; toes that are never lower are those of a body that hangs or flies
STILL = 0.015  # metres of noise of an ankle, or of a toe's height; a larger movement is a heel or foot that rolls


def clean_feet(
    joints: Array, skeleton: Skeleton, fps: float, *, contacts: Bool | None = None, rule: ContactRule = RULE
) -> tuple[Array, Bool]:
    """Put the floor at y = 0, lock standing feet, and lift feet out of the floor.

    Args:
        joints: (T, J, 3) metres, Y up.
        skeleton: must have feet, hips and legs.
        fps: frames a second.
        contacts: (T, 4) bool; None = detect them. Feet above the floor have none.
        rule: thresholds in metres and seconds.

    Returns:
        (T, J, 3) float64 in metres, with the bone lengths of `joints`; and contacts (T, 4) bool.

    Raises:
        InvalidInput: the skeleton has no feet.
    """
    joints = np.array(joints, np.float64)
    need_feet(skeleton)
    joints[..., 1] -= floor_height(joints, skeleton)
    stands = find_contacts(joints, skeleton, fps, rule=rule) if contacts is None else np.array(contacts, bool)
    stands &= _over_floor(joints, skeleton, rule)
    before = joints.copy()
    for side in range(2):
        ankle, toe = skeleton.feet[2 * side : 2 * side + 2]
        stands[:, 2 * side + 1] &= ~_slides(joints[:, toe], stands[:, 2 * side + 1], rule)
        _plant(joints, skeleton, (ankle, toe), stands[:, 2 * side : 2 * side + 2], fps)
    follow_feet(before, joints, stands[:, 1::2], skeleton, fps)
    return joints, stands


def rule_for(joints: Array, fps: float) -> ContactRule:
    """Return the thresholds for a motion (T, J, 3), metres: wider ones for a body that runs nearly all the time."""
    if len(joints) < 2:
        return RULE
    speed = np.linalg.norm(np.diff(joints[:, 0, [0, 2]], axis=0), axis=-1) * fps
    usual = float(np.quantile(speed, 0.25))
    return RULE if usual < RUNNING else replace(RULE, enter_speed=_ENTER * usual, leave_speed=_LEAVE * usual)


def need_feet(skeleton: Skeleton) -> None:
    """Check that the skeleton has feet and hips; raise InvalidInput otherwise."""
    if len(skeleton.feet) != 4 or len(skeleton.facing) != 4:
        raise InvalidInput("this skeleton's feet or hips are unknown", where=skeleton.name)


def floor_height(joints: Array, skeleton: Skeleton) -> float:
    """Return the height of the floor over y = 0 in metres; zero while toes stand within `FLOOR_BAND`, and for a body in
    the air.

    The height at which toes stand is the tenth percentile of the lowest toe's: bouncing and tiptoe do not lift it. A
    body that lies or kneels on other parts, its feet raised, is let down no further than these.
    """
    height = float(np.quantile(joints[:, list(skeleton.feet[1::2]), 1].min(axis=1), 0.1))
    if height > AIR:
        return 0.0
    floor = height - float(np.clip(height, *FLOOR_BAND))
    if floor > 0 and skeleton.joint_names == HUMANML3D.joint_names:
        return min(floor, max(float(np.quantile(clearance(joints), 0.1)), 0.0))
    return floor


def find_contacts(joints: Array, skeleton: Skeleton, fps: float, *, rule: ContactRule = RULE) -> Bool:
    """Detect foot contacts (T, 4): L ankle, L toe, R ankle, R toe.

    A foot begins to stand when it is low and slow, and stands until it is high or clearly moving. Low is relative to
    the tenth percentile of the joint's own height, the lower of both sides: rigs differ in where the joint sits. Feet
    of a body in the air do not stand, however still they are.
    """
    if len(skeleton.feet) != 4:
        raise InvalidInput("this skeleton's feet are unknown", where=skeleton.name)
    places = joints[:, list(skeleton.feet)]
    speed = np.linalg.norm(np.gradient(places, axis=0), axis=-1) * fps if len(joints) > 1 else np.zeros((1, 4))
    ground = np.quantile(places[..., 1], 0.1, axis=0)
    ground = np.minimum(ground, ground[OTHER_FOOT])
    ground = np.where(ground > AIR, 0.0, ground)
    low = places[..., 1] - ground < np.array([rule.ankle_height, rule.toe_height] * 2)
    stands = np.zeros(speed.shape, bool)
    for foot in range(4):
        stay = low[:, foot] & (speed[:, foot] < rule.leave_speed)
        slow = low[:, foot] & (speed[:, foot] < rule.enter_speed)
        for begin, end in runs(stay):
            inside = np.flatnonzero(slow[begin:end])
            if len(inside):
                stands[begin + inside[0] : begin + inside[-1] + 1, foot] = True
        for begin, end in runs(~stands[:, foot]):
            if begin and end < len(stands) and (end - begin) / fps <= rule.gap and low[begin:end, foot].all():
                stands[begin:end, foot] = True
        for begin, end in runs(stands[:, foot]):
            if (end - begin) / fps < rule.shortest:
                stands[begin:end, foot] = False
    return stands


def heights(joints: Array, skeleton: Skeleton) -> Array:
    """Return metres (T, 4) of the joints of the feet over their standing height, the lower one of both sides."""
    height = joints[:, list(skeleton.feet), 1]
    ground = np.quantile(height, 0.1, axis=0)
    return height - np.minimum(ground, ground[OTHER_FOOT])


def _over_floor(joints: Array, skeleton: Skeleton, rule: ContactRule) -> Bool:
    """Return the frames (T, 4) in which the foot of each joint can stand on a floor at y = 0: one that is held still
    above it does not."""
    low = joints[:, list(skeleton.feet[1::2]), 1] < FLOOR_BAND[1] + rule.toe_height
    return np.repeat(low, 2, axis=1)


def runs(mask: Bool) -> list[tuple[int, int]]:
    """Return (begin, end) of each stretch of True, end exclusive."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    return [(int(b), int(e)) for b, e in zip(edges[::2], edges[1::2], strict=True)]


def skate(joints: Array, contacts: Bool, skeleton: Skeleton, fps: float) -> float:
    """Return the mean horizontal speed in m/s of toes between two frames in which they stand; 0 if they never do."""
    toes = list(skeleton.feet[1::2])
    speed = np.linalg.norm(np.diff(joints[:, toes], axis=0)[..., [0, 2]], axis=-1) * fps
    both = contacts[1:, 1::2] & contacts[:-1, 1::2]
    return float(speed[both].mean()) if both.any() else 0.0


def _slides(toe: Array, stands: Bool, rule: ContactRule) -> Bool:
    """Return the frames of contacts that are slides: the toe moves too far from its mean position."""
    mask = np.zeros(len(toe), bool)
    for begin, end in runs(stands):
        stray = np.linalg.norm((toe[begin:end] - toe[begin:end].mean(axis=0))[:, [0, 2]], axis=1).max()
        mask[begin:end] = stray > rule.slide
    return mask


def _plant(joints: Array, skeleton: Skeleton, foot: tuple[int, int], stands: Bool, fps: float) -> None:
    """Move one foot, in place: the toe to its locks, the ankle with it, and to its own locks where both stand."""
    ankle, toe = foot
    chain = foot_chain(skeleton, toe)
    lengths = [np.linalg.norm(joints[:, a] - joints[:, b], axis=-1, keepdims=True) for a, b in _pairs(chain)]
    shift = np.zeros((len(joints), 3))
    for begin, end in runs(stands[:, 1]):
        places = joints[begin:end, toe]
        shift[begin:end] = places.mean(axis=0) - places
        height = float(np.median(places[:, 1]))
        if np.abs(places[:, 1] - height).max() <= STILL:
            shift[begin:end, 1] = np.clip(height, *FLOOR_BAND) - places[:, 1]
        else:
            shift[begin:end, 1] = np.clip(height, *FLOOR_BAND) - height
    shift = _fill(shift, stands[:, 1], fps)
    for j in chain:
        joints[:, j] += shift
    joints[:, toe, 1] = over_floor(joints[:, toe, 1])
    turn, still = np.zeros((len(joints), 3)), np.zeros(len(joints), bool)
    for begin, end in runs(stands[:, 0] & stands[:, 1]):
        correction = joints[begin:end, ankle].mean(axis=0) - joints[begin:end, ankle]
        if np.linalg.norm(correction, axis=1).max() <= STILL:
            turn[begin:end], still[begin:end] = correction, True
    turn = _fill(turn, still, fps)
    for j in chain[1:]:
        joints[:, j] += turn
    for (child, parent), length in zip(_pairs(chain), lengths, strict=True):
        joints[:, parent] = joints[:, child] + length * normalize(joints[:, parent] - joints[:, child])


def _pairs(chain: list[int]) -> list[tuple[int, int]]:
    return list(pairwise(chain))


def _fill(values: Array, known: Bool, fps: float) -> Array:
    """Return the known stretches' values, joined by cubic Hermite curves that meet value and slope at both ends.

    Over gaps longer than `LONG_SWING`, and before the first and after the last stretch, the curve runs to zero within
    `RELEASE` seconds.
    """
    values = np.where(known[:, None], values, 0.0)
    release = max(2, round(RELEASE * fps))
    slopes = np.gradient(values, axis=0) if len(values) > 1 else values
    stretches = runs(known)
    for begin, end in stretches:  # one-sided, from inside
        inner = values[begin : min(begin + 3, end)], values[max(begin, end - 3) : end]
        slopes[begin] = np.diff(inner[0], axis=0).mean(axis=0) if end - begin > 1 else 0
        slopes[end - 1] = np.diff(inner[1], axis=0).mean(axis=0) if end - begin > 1 else 0
    last = None
    for begin, end in [*stretches, (len(values) + release, 0)]:
        first = last if last is not None else -release
        if last is not None and begin < len(values) and (begin - last) / fps <= LONG_SWING:
            _bridge(values, last, begin, values[last], values[begin], slopes[last], slopes[begin])
        else:
            zero = np.zeros(values.shape[1])
            if last is not None:
                stop = min(last + release, max(begin - 1, last + 1))
                _bridge(values, last, stop, values[last], zero, slopes[last], zero)
            if begin < len(values):
                start = max(begin - release, first + 1 if last is None else last + release)
                start = min(start, begin - 1)
                _bridge(values, start, begin, zero, values[begin], zero, slopes[begin])
        last = end - 1
    return values


def _bridge(values: Array, a: int, b: int, va: Array, vb: Array, sa: Array, sb: Array) -> None:
    """Fill frames between a and b (both exclusive) with a cubic Hermite curve, as far as they are in the clip."""
    frames = np.arange(max(a + 1, 0), min(b, len(values)))
    n = b - a
    t = ((frames - a) / n)[:, None]
    values[frames] = (
        (1 + 2 * t) * (1 - t) ** 2 * va + t * (1 - t) ** 2 * n * sa + t**2 * (3 - 2 * t) * vb + t**2 * (t - 1) * n * sb
    )


def over_floor(height: Array) -> Array:
    """Compress heights below zero smoothly to at most `PRESS` below the floor; heights above are unchanged."""
    return np.where(height < 0, PRESS * np.expm1(np.minimum(height, 0.0) / PRESS), height)
