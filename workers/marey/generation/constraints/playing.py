"""Play a motion at other moments: pieces follow one another where it goes on at another one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from marey.generation.constraints.poses import BodyMotion
from marey.generation.constraints.timing import Timing
from marey.motion.clip import MotionClip
from marey.motion.curves import hump
from marey.motion.feet import clean_feet
from marey.motion.kinematics import facing, forward_kinematics
from marey.motion.legs import follow_feet, foot_chain
from marey.motion.pose import aim_bones
from marey.motion.resample import interpolate, interpolate_rotations
from marey.motion.rotations import Array, about, conjugate, from_rotvec, multiply, rotate, to_rotvec
from marey.motion.skeleton import Skeleton

BLEND_S = 0.25
"""Seconds on each side of a seam within which both motions pass into each other."""


def played(clip: MotionClip, timing: Timing) -> BodyMotion:
    """Return a clip as it is at other moments; at seams the poses pass into each other, and feet stand still."""
    times = timing.times
    if len(times) == clip.frames and np.array_equal(times, np.arange(clip.frames)):
        return BodyMotion(clip.rotations.astype(np.float64), clip.root.astype(np.float64), clip.contacts)
    rotations, root = clip.rotations.astype(np.float64), clip.root.astype(np.float64)
    turns, moved = interpolate_rotations(rotations, times), interpolate(root, times)
    contacts = clip.contacts[np.rint(times).astype(np.intp)]
    skeleton, span = clip.skeleton, round(BLEND_S * clip.fps)
    if not timing.begins:
        return _on_its_feet(clip, times, BodyMotion(turns, moved, contacts))
    for before, piece in zip(timing.pieces, timing.pieces[1:], strict=False):
        after = min(times[before.stop - 1] + 1, clip.frames - 1.0)  # that the piece before would have shown next
        next_turns = interpolate_rotations(rotations, np.array([after]))[0]
        next_root = interpolate(root, np.array([after]))[0]
        # Both in the world of the piece before, which was placed itself.
        last = before.stop - 1
        place = _to(interpolate_rotations(rotations, times[last : last + 1])[0],
                    interpolate(root, times[last : last + 1])[0], turns[last], moved[last], skeleton)  # fmt: skip
        next_turns, next_root = _moved(next_turns[None], next_root[None], *place)
        own = _to(turns[piece.start], moved[piece.start], next_turns[0], next_root[0], skeleton)
        turns[piece], moved[piece] = _moved(turns[piece], moved[piece], *own)
        _blend(turns, moved, next_turns[0], next_root[0], piece.start, span)
    return with_locked_feet(BodyMotion(turns, moved, contacts), skeleton, clip.fps, contacts=contacts)


def with_locked_feet(
    motion: BodyMotion, skeleton: Skeleton, fps: float, *, contacts: NDArray[np.bool_] | None = None
) -> BodyMotion:
    """Return a motion whose standing feet stay in their places.

    Args:
        contacts: (T, 4) in which feet stand; None = where they are found to.
    """
    joints, stands = clean_feet(motion.joints(skeleton), skeleton, fps, contacts=contacts)
    return BodyMotion(aim_bones(joints, motion.rotations, skeleton), joints[:, 0], stands)


def _on_its_feet(clip: MotionClip, times: Array, motion: BodyMotion) -> BodyMotion:
    """Return a clip at other moments with its feet where they are then: between frames, rotations and root that are
    interpolated each by itself move a foot that stands."""
    skeleton = clip.skeleton
    before = motion.joints(skeleton)
    joints, own = before.copy(), clip.joints.astype(np.float64)
    for toe in skeleton.feet[1::2]:
        foot = foot_chain(skeleton, toe)
        joints[:, foot] = interpolate(own[:, foot], times)
    follow_feet(before, joints, motion.contacts[:, 1::2], skeleton, clip.fps)
    return BodyMotion(aim_bones(joints, motion.rotations, skeleton), joints[:, 0], motion.contacts)


def _to(turns: Array, root: Array, there_turns: Array, there_root: Array, skeleton: Skeleton) -> tuple[Array, Array]:
    """Return the turn (4,) about the vertical and the shift (3,) on the floor that take one pose to the place of
    another."""
    both = forward_kinematics(skeleton, np.stack([turns, there_turns]), np.zeros((2, 3)))
    ahead = facing(both, skeleton)
    here, there = np.arctan2(ahead[:, 0], ahead[:, 2])
    turn = about("Y", there - here)
    return turn, (there_root - rotate(turn, root)) * np.array([1.0, 0.0, 1.0])


def _moved(turns: Array, root: Array, turn: Array, shift: Array) -> tuple[Array, Array]:
    turns = turns.copy()
    turns[:, 0] = multiply(turn, turns[:, 0])
    return turns, rotate(turn, root) + shift


def _blend(turns: Array, root: Array, wanted: Array, place: Array, seam: int, span: int) -> None:
    """Spread the difference at a seam over the frames beside it, half to each side, in place."""
    apart, way = to_rotvec(multiply(wanted, conjugate(turns[seam]))), place - root[seam]
    frames = np.arange(max(seam - span, 0), min(seam + span, len(turns)))
    weight = 0.5 * hump((frames - seam + 0.5) / span) * np.where(frames < seam, -1.0, 1.0)
    turns[frames] = multiply(from_rotvec(weight[:, None, None] * apart), turns[frames])
    root[frames] += weight[:, None] * way
