"""Motions at each other's ends: the second is moved to the last pose of the first, and their difference fades.

The difference of poses and of speeds at the joint is added to the second motion and fades out (inertialisation, Bollo,
"Inertialization: High-Performance Animation Transitions in Gears of War", GDC 2018), here by a cubic Hermite curve.
"""

from __future__ import annotations

from dataclasses import replace
from typing import cast

import numpy as np

from marey.motion.clip import MotionClip
from marey.motion.edits.place import heading_of, moved, posed
from marey.motion.filters import smoothstep
from marey.motion.rotations import Array, about, conjugate, from_rotvec, multiply, rotate, to_rotvec

SAME_TURN, SAME_PLACE = 2e-3, 1e-3
"""Radians and metres up to which two poses are the same: pieces of one motion are joined as they are."""


def placed_after(clip: MotionClip, second: MotionClip) -> MotionClip:
    """Return the second motion moved and turned on the floor so that it begins where the clip ends."""
    turn = about("Y", heading_of(clip, -1) - heading_of(second, 0))
    shift = clip.root[-1].astype(np.float64) - rotate(turn, second.root[0].astype(np.float64))
    return moved(second, turn, shift * np.array([1.0, 0.0, 1.0]))


def faded_in(clip: MotionClip, second: MotionClip, frames: int) -> tuple[Array, Array]:
    """Return rotations (m, J, 4) and root (m, 3) of the placed second motion, with the difference at its beginning.

    Args:
        clip: ends at the first pose of the second motion.
        second: the motion.
        frames: number of frames in which the difference fades.
    """
    rotations, root = second.rotations.astype(np.float64), second.root.astype(np.float64)
    turn = to_rotvec(multiply(clip.rotations[-1].astype(np.float64), conjugate(rotations[0])))
    way = clip.root[-1].astype(np.float64) - root[0]
    if np.abs(turn).max() <= SAME_TURN and np.abs(way).max() <= SAME_PLACE:
        return rotations, root
    turning, moving = _speed(clip, slice(-2, None)), _speed(second, slice(0, 2))
    span = min(frames, len(root) - 1)
    k = np.arange(span + 1, dtype=np.float64)[:, None]
    turns = from_rotvec(fade(turn, turning[0] - moving[0], k[..., None], span))
    rotations[: span + 1] = multiply(turns, rotations[: span + 1])
    root[: span + 1] += fade(way, turning[1] - moving[1], k, span)
    return rotations, root


def _speed(clip: MotionClip, two: slice) -> tuple[Array, Array]:
    """Return how far joints (J, 3) turn and the root (3,) moves from one frame to the next: radians, metres."""
    rotations, root = clip.rotations[two].astype(np.float64), clip.root[two].astype(np.float64)
    if len(root) < 2:
        return np.zeros((len(clip.skeleton), 3)), np.zeros(3)
    return to_rotvec(multiply(rotations[1], conjugate(rotations[0]))), root[1] - root[0]


def fade(value: Array, slope: Array, k: Array, span: int) -> Array:
    """Return a cubic Hermite curve from `value`, with `slope` a frame, at k = 0 to zero at k = span."""
    if span < 1:
        return np.where(k == 0, value, 0.0)
    t = k / span
    return (1 + 2 * t) * (1 - t) ** 2 * value + t * (1 - t) ** 2 * span * slope


def bridged(
    before: MotionClip | None, piece: MotionClip, after: MotionClip | None, frames: int, *, stay: bool = False
) -> tuple[MotionClip, MotionClip | None]:
    """Fit a piece between two motions; their frames stay as they are.

    Args:
        before: its last pose is the first of the piece; None = the piece begins the motion.
        piece: of the same skeleton and rate.
        after: its first pose is the last of the piece; None = the piece ends the motion.
        frames: number of frames of the piece in which a difference fades, at each end.
        stay: the motion after keeps its place, and the piece is led there; otherwise it follows the piece.

    Returns:
        The piece, and the motion after at its place.
    """
    frames = max(1, min(frames, piece.frames // 2))
    if before is not None:
        piece = posed_like(piece, *faded_in(before, placed_after(before, piece), frames))
    if after is None:
        return piece, None
    if stay:
        piece = _led_to(piece, after)
    elif before is None:
        piece = _backwards(placed_after(_backwards(after), _backwards(piece)))
    else:
        after = placed_after(piece, after)
    turned = faded_in(_backwards(after), _backwards(piece), frames)
    return _backwards(posed_like(piece, *turned)), after


def posed_like(clip: MotionClip, rotations: Array, root: Array) -> MotionClip:
    """Return the clip with other poses of as many frames."""
    return posed(clip, rotations, root, contacts=clip.contacts)


def _led_to(piece: MotionClip, after: MotionClip) -> MotionClip:
    """Return the piece with its way and turn changed bit by bit, so that it ends where the motion after begins."""
    share = smoothstep(np.linspace(0.0, 1.0, piece.frames))
    angle = heading_of(after, 0) - heading_of(piece, -1)
    angle = np.arctan2(np.sin(angle), np.cos(angle))
    rotations, root = piece.rotations.astype(np.float64), piece.root.astype(np.float64)
    rotations[:, 0] = multiply(about("Y", cast("Array", share * angle)), rotations[:, 0])
    way = (after.root[0].astype(np.float64) - root[-1]) * np.array([1.0, 0.0, 1.0])
    return posed_like(piece, rotations, root + share[:, None] * way)


def _backwards(clip: MotionClip) -> MotionClip:
    return replace(
        clip,
        rotations=clip.rotations[::-1],
        root=clip.root[::-1],
        joints=clip.joints[::-1],
        contacts=clip.contacts[::-1],
    )
