"""Join real clips with inertialized transitions (Bollo 2018, "Inertialization", GDC: the difference of pose and
velocity at the seam is added to the second clip and decays by a quintic).

The second clip is rotated to the heading of the first and moved so that a standing foot stays in place. Root, toes,
foot directions and bone directions are inertialized separately; bones keep their length, and knees are solved between
hip and ankle, so that a standing foot does not slide while the body slows down or starts to move.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from marey.checks.kinematics import heading
from marey.motion.rotations import between, from_rotvec, normalize, rotate, to_rotvec
from marey.posing.bones import directions_of, knee_poles, rebuilt
from marey.posing.limbs import LEG_CHAINS, LEVEL

Array = NDArray[np.floating]

BLEND_SECONDS = 0.5
_STAND_SPEED = 0.35  # metres a second; a low toe that is slower stands
_STAND_HEIGHT = 0.05  # metres of a toe that stands, at most
_STEP_FROM = 0.015  # metres; a standing foot displaced by less is not lifted


def quintic(offset: Array, velocity: Array, frames: int) -> Array:
    """Decay of an offset (...,) with an initial velocity per frame to zero: (frames, ...) at 1, 2, …, `frames`.

    x(0) and x'(0) are given, x''(0) = 0, and x, x', x'' vanish at the end.
    """
    s = np.arange(1, frames + 1).reshape(-1, *[1] * offset.ndim) / frames
    position = 1 - 10 * s**3 + 15 * s**4 - 6 * s**5
    speed = s - 6 * s**3 + 8 * s**4 - 3 * s**5
    return position * offset + speed * velocity * frames


def place_after(first: Array, second: Array, fps: float) -> Array:
    """Rotate and move the second clip (T, 22, 3) over the floor so that it continues the first: with its heading, and
    with the toe in place that stands on both sides of the seam, or the pelvis if none does.

    Args:
        first, second: joints in metres, Y up, at least two frames each.
        fps: frames a second of both.
    """
    turn = np.radians(heading(first[-8:], fps)[-1] - heading(second[:8], fps)[0])
    c, s = np.cos(turn), np.sin(turn)
    turned = second @ np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]]).T
    foot = _shared_foot(first, turned, fps)
    anchor = 0 if foot is None else foot
    shift = first[-1, anchor] - turned[0, anchor]
    return turned + shift * LEVEL


def _stands(points: Array, fps: float) -> bool:
    """Return True if a toe (n >= 2, 3) is standing at the seam."""
    speed = np.linalg.norm(points[1] - points[0]) * fps
    return bool(speed < _STAND_SPEED and points[:, 1].min() < _STAND_HEIGHT)


def _shared_foot(first: Array, second: Array, fps: float) -> int | None:
    """Toe joint that stands on both sides of the seam (the slower one of two), or None."""
    best, least = None, np.inf
    for _, _, _, toe in LEG_CHAINS:
        if _stands(first[-2:, toe], fps) and _stands(second[:2, toe], fps):
            speed = np.linalg.norm(first[-1, toe] - first[-2, toe]) + np.linalg.norm(second[1, toe] - second[0, toe])
            if speed < least:
                best, least = toe, speed
    return best


def join_clips(first: Array, second: Array, fps: float) -> Array:
    """Join two motions (T1, 22, 3) and (T2, 22, 3): the first, then the second without its first frame (T1 + T2 - 1).

    Both need at least two frames; the second is placed by `place_after`.
    """
    first, second = np.asarray(first, np.float64), np.asarray(second, np.float64)
    second = place_after(first, second, fps)
    frames = min(round(BLEND_SECONDS * fps), len(second) - 1)
    tail = second[1:].copy()
    tail[:frames] = rebuilt(*_blend(first, second, frames, fps))
    return np.concatenate([first, tail])


def _blend(first: Array, second: Array, frames: int, fps: float) -> tuple[Array, Array, Array, Array]:
    """Root (n, 3), directions (n, 22, 3), toes (n, 2, 3) and knee poles (n, 2, 3) of the blended frames."""
    target = second[1 : frames + 1]

    def decayed(a: Array, b: Array, seam: Array) -> Array:
        """Add the decaying offset between the last two frames `a` and the first two frames `b` to `seam`."""
        return seam + quintic(a[1] - b[0], (a[1] - a[0]) - (b[1] - b[0]), frames)

    ends = (first[-2:], second[:2])
    root = decayed(ends[0][:, 0], ends[1][:, 0], target[:, 0])
    toes = decayed(ends[0][:, [10, 11]], ends[1][:, [10, 11]], target[:, [10, 11]])
    toes[..., 1] = np.maximum(
        toes[..., 1] + _lift(ends[0], ends[1], frames, fps), np.minimum(target[:, [10, 11], 1], 0)
    )
    directions = turned(directions_of(ends[0]), directions_of(ends[1]), directions_of(target))
    return root, directions, toes, turned(knee_poles(ends[0]), knee_poles(ends[1]), knee_poles(target))


def turned(first: Array, second: Array, target: Array) -> Array:
    """Inertialize unit vectors (n, K, 3) as rotations: the rotation from the second clip to the first at the seam, and
    its rate of change, decay to zero.

    Differences of vectors do not work: if an arm swings by more than a right angle within the blend, its direction and
    the decaying difference nearly cancel, and the arm jumps (1 in 20 joins had more jerk than any capture).

    Args:
        first: (2, K, 3) the last two frames of the first clip.
        second: (2, K, 3) the first two of the second.
        target: (n, K, 3) the second clip, from its second frame on.
    """
    now = to_rotvec(between(second[0], first[1])).astype(np.float64)
    before = to_rotvec(between(normalize(2 * second[0] - second[1]), first[0]))
    decayed = from_rotvec(quintic(now, now - before, len(target)))
    return normalize(rotate(decayed, target)).astype(np.float64)


def _lift(before: Array, after: Array, frames: int, fps: float) -> Array:
    """Extra height (n, 2) for a small step of a foot that stands on both sides of the seam, but in different places."""
    out = np.zeros((frames, 2))
    bump = np.sin(np.pi * np.arange(1, frames + 1) / (frames + 1)) ** 2
    for side, toe in enumerate((10, 11)):
        offset = float(np.linalg.norm((before[1, toe] - after[0, toe])[[0, 2]]))
        if offset > _STEP_FROM and (_stands(before[:, toe], fps) or _stands(after[:, toe], fps)):
            out[:, side] = min(0.12, 0.04 + 0.3 * offset) * bump
    return out


# -- where to cut --------------------------------------------------------------------------------------------------


def seam_features(joints: Array, fps: float) -> Array:
    """Features (T, K) of each frame for finding seams: pose and velocities in the body's frame, in metres.

    Feet have double weight, since a displaced foot must step; velocities count as the distance covered in 0.15 s.
    """
    angle = np.radians(heading(joints, fps))
    c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]

    def local(v: Array) -> Array:
        return np.stack([v[..., 0] * c - v[..., 2] * s, v[..., 1], v[..., 0] * s + v[..., 2] * c], axis=-1)

    pose = local(joints - joints[:, :1] * np.array([1.0, 0.0, 1.0]))
    speed = local(np.gradient(joints, axis=0) * fps)
    weights = np.ones(22)
    weights[[7, 8, 10, 11]] = 2.0
    weights[[3, 6, 9, 12, 13, 14]] = 0.5
    parts = [pose * weights[:, None], 0.15 * speed * weights[:, None]]
    return np.concatenate([part.reshape(len(joints), -1) for part in parts], axis=1)


def seam_costs(first: Array, second: Array) -> Array:
    """Cost (T1, T2) of a seam between frame i of one clip and frame j of the other: mean squared feature difference."""
    squares = (first**2).sum(1)[:, None] + (second**2).sum(1)[None] - 2 * first @ second.T
    return np.maximum(squares, 0.0) / 22
