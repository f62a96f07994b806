"""Lengthen or shorten a single action."""

from __future__ import annotations

import random
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from marey.data.cuts import WORST_SEAM, best_cut, core, hold
from marey.data.part import FPS, MAX_FRAMES, Part
from marey.data.splice import join_clips

Array = NDArray[np.floating]
LIMIT = MAX_FRAMES + 1  # poses
_LEAST_STEPS = 15
_WORST_STEP = WORST_SEAM / 4
Made = tuple[Array, tuple[Part, ...], int]
"""Joints (T, 22, 3), source clips, and number of repetitions of the action."""


def crop(part: Part, target: int, rng: random.Random) -> Made:
    """Take a random crop of `target` poses, or the whole clip if it is shorter."""
    length = min(target, len(part.joints))
    first = rng.randint(0, len(part.joints) - length)
    return part.joints[first : first + length].astype(np.float64), (part,), 1


def loop(part: Part, target: int) -> Made | None:
    """Loop a gait: repeatedly jump back to the best matching frame."""
    frames = len(part.joints)
    half = max(frames // 2, 8)
    i, j, cost = best_cut(part, range(max(half, frames - 30), frames), part, range(min(half, 30)))
    if cost > 0.15 or i - j < 10:
        return None
    whole = part.joints.astype(np.float64)
    joints = whole[: i + 1]
    while len(joints) < target:
        joints = join_clips(joints, whole[j : i + 1], FPS)
    return joints[:target], (part,) * 2, 1


def stretch(part: Part, target: int, rng: random.Random, *, repeat_share: float = 0.35) -> Made | None:
    """Change the length of a gesture: hold or wave for longer or shorter, repeat it, or stand for longer around it."""
    a, b = core(part)
    whole = part.joints.astype(np.float64)
    last = len(whole) - 1
    if last - b >= 4 and a >= 1 and rng.random() < repeat_share and target > 1.4 * (b - a):
        joints, repeats = whole, 1
        while len(joints) + (b - a) < target and repeats < 4:
            i, j, cost = best_cut(part, range(b, last + 1), part, range(a + 1))
            if cost > 0.1:
                return None
            joints = join_clips(joints[: len(joints) - (last - i)], whole[j:], FPS)
            repeats += 1
        return (joints[:LIMIT], (part,) * repeats, repeats) if repeats > 1 and len(joints) <= LIMIT else None
    held = hold(part, a, b)
    if held is None:
        return None
    x, y = held
    joints = whole[: y + 1]
    if part.facts.action == "raise" and target > len(whole):
        return held_longer(whole, x, y, target - len(whole)), (part,) * 2, 1
    if target < len(whole):  # skip part of the hold
        third = max((y - x) // 3, 1)
        leave, enter = range(max(x, 1), x + third + 1), range(max(x, y - third), min(y + 1, last))
        i, j, cost = best_cut(part, leave, part, enter)
        joints = whole[: i + 1]
        return (join_clips(joints, whole[j:], FPS), (part,) * 2, 1) if cost < 0.1 and j - i > 8 else None
    third = max((y - x) // 3, 2)
    i, j, cost = best_cut(part, range(y - third, y + 1), part, range(x, x + third))
    if cost > 0.05 or i - j < 5 or i == last:  # a hand that is up until the end has nothing to fall to
        return None
    joints = whole[: i + 1]
    while len(joints) + (last - i) < target:
        joints = join_clips(joints, whole[j : i + 1], FPS)
    joints = np.concatenate([joints[:-1], join_clips(joints[-2:], whole[i:], FPS)[1:]])
    return joints[:LIMIT], (part,) * 2, 1


def held_longer(joints: Array, first: int, last: int, more: int) -> Array:
    """Slow down the frames first..last of (T, 22, 3) by `more` frames; return (T + more, 22, 3).

    Looping a held hand would move it back and forth like a wave. Time runs at normal speed at both ends and slows down
    over a few frames, so that the rise before and the fall after are as captured.
    """
    steps = last - first + more
    ends = np.minimum(np.arange(steps), np.arange(steps)[::-1])
    near = np.clip(1 - ends / 5, 0, 1)
    slow = (last - first - near.sum()) / (steps - near.sum())
    at = first + np.concatenate([[0.0], np.cumsum(slow + (1 - slow) * near)])
    below = np.clip(at.astype(int), first, last - 1)
    part = (at - below)[:, None, None]
    held = (1 - part) * joints[below] + part * joints[below + 1]
    return np.concatenate([joints[:first], held, joints[last + 1 :]])


def on_a_way(turn: Part, walk: Part, target: int, before: float) -> Made | None:
    """Put a turn into a longer walk.

    Args:
        turn: the captured turn.
        walk: a straight walk in the same style; it is looped if too short.
        target: poses of the result, LIMIT at most.
        before: share of the added poses that lie before the turn, 0 to 1.

    Returns:
        None if the seams cost too much or there is no room for more steps.
    """
    first, last = core(turn)
    room = target - len(turn.joints)
    lead, tail = round(before * room), room - round(before * room)
    joints = turn.joints.astype(np.float64)
    if tail >= _LEAST_STEPS:
        way = _way(walk, tail + 40)
        leave = range(min(last, len(joints) - 2), len(joints))
        found = way and best_cut(turn, leave, way, range(40))
        if not way or not found or found[2] > _WORST_STEP:
            return None
        i, j, _ = found
        joints = join_clips(joints[: i + 1], way.joints[j:].astype(np.float64), FPS)
    if lead >= _LEAST_STEPS:
        way = _way(walk, lead)
        leave = range(max(lead - 20, _LEAST_STEPS - 5), lead)
        found = way and best_cut(way, range(leave.start, min(lead, len(way.joints))), turn, range(max(1, first)))
        if not way or not found or found[2] > _WORST_STEP:
            return None
        i, j, _ = found
        joints = join_clips(way.joints[: i + 1].astype(np.float64), joints[j:], FPS)
    return (joints[:target], (walk, turn), 1) if len(joints) > len(turn.joints) else None


def _way(walk: Part, frames: int) -> Part | None:
    """Loop a walk to `frames` poses; return a longer walk unchanged."""
    if len(walk.joints) >= frames:
        return walk
    made = loop(walk, frames)
    return None if made is None else replace(walk, joints=made[0].astype(np.float32))
