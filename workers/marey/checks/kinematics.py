"""Measurements on joints: heading, travel, steps, hands, trunk. No labels, no features, no learned network.

All functions take joints (T, 22, 3) of HumanML3D in metres, Y up, and frames a second. Angles are in degrees, positive
to the body's left.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from marey.motion.feet import runs
from marey.motion.filters import smooth_seconds

Array = NDArray[np.floating]

PELVIS, NECK, HEAD = 0, 12, 15
HIPS, SHOULDERS, ELBOWS, WRISTS = (1, 2), (16, 17), (18, 19), (20, 21)  # left, right
KNEES, ANKLES, TOES = (4, 5), (7, 8), (10, 11)


def velocity(points: Array, fps: float) -> Array:
    """Central differences along axis 0, units a second."""
    return np.gradient(points, axis=0) * fps if len(points) > 1 else np.zeros_like(points)


def heading(joints: Array, fps: float) -> Array:
    """(T,) the body's heading in degrees, unwrapped, smoothed over a third of a second.

    0 is +Z; positive is to the left (+X).
    """
    across = joints[:, HIPS[0]] - joints[:, HIPS[1]] + joints[:, SHOULDERS[0]] - joints[:, SHOULDERS[1]]
    flat = smooth_seconds(across[:, [0, 2]], 0.15, fps)
    # forward = across x up = (-across_z, across_x) in (x, z)
    angle = np.unwrap(np.arctan2(-flat[:, 1], flat[:, 0]))
    return np.degrees(smooth_seconds(angle, 0.3, fps))


def body_frame(vectors: Array, heading_degrees: Array) -> tuple[Array, Array]:
    """Forward and left components of horizontal vectors (T, 3), seen from headings (T,) or one heading."""
    angle = np.radians(heading_degrees)
    forward = vectors[..., 0] * np.sin(angle) + vectors[..., 2] * np.cos(angle)
    left = vectors[..., 0] * np.cos(angle) - vectors[..., 2] * np.sin(angle)
    return forward, left


def variety(joints: Array, heading_degrees: Array, pair: tuple[int, int]) -> float:
    """Root mean square of how far the two joints of a pair get from their mean place in the body, metres.

    Args:
        joints: (T, 22, 3) metres.
        heading_degrees: (T,) of the body.
        pair: `ANKLES` or `WRISTS`.
    """
    limbs = joints[:, list(pair)] - joints[:, [PELVIS]]
    forward, left = body_frame(limbs, heading_degrees[:, None])
    local = np.stack([forward, limbs[..., 1], left], axis=-1)
    return float(np.sqrt(np.sum((local - local.mean(axis=0)) ** 2, axis=-1).mean()))


@dataclass(frozen=True)
class GaitMeasures:
    """Travel of the body.

    Attributes:
        duration: seconds.
        path: metres along the way of the pelvis, smoothed.
        forward, left: metres from start to end, in the body frame of the start.
        along: metres travelled in the direction the body faces, at each moment (negative: backward).
        sideways: metres travelled to the body's left, at each moment.
        turn: degrees of heading from start to end.
        swing: degrees between the extreme headings; more than |turn| when the body turns to and fro.
        speed: mean speed while moving, metres a second.
        steps: how many times a foot was set on.
        airborne: share of frames with both feet off the floor.
    """

    duration: float
    path: float
    forward: float
    left: float
    along: float
    sideways: float
    turn: float
    swing: float
    speed: float
    steps: int
    airborne: float


def gait(joints: Array, fps: float) -> GaitMeasures:
    """Measure the travel of a motion (T, 22, 3)."""
    joints = np.asarray(joints, np.float64)
    angle = heading(joints, fps)
    pelvis = smooth_seconds(joints[:, PELVIS], 0.1, fps)
    flow = np.diff(pelvis, axis=0)
    along, sideways = body_frame(flow, (angle[:-1] + angle[1:]) / 2)
    forward, left = body_frame(pelvis[-1] - pelvis[0], angle[0])
    travelled = np.hypot(flow[:, 0], flow[:, 2])
    moving = travelled * fps > 0.25
    path = float(travelled[moving].sum())
    return GaitMeasures(
        duration=len(joints) / fps,
        path=path,
        forward=float(forward),
        left=float(left),
        along=float(along.sum()),
        sideways=float(sideways.sum()),
        turn=float(angle[-1] - angle[0]),
        swing=float(np.ptp(angle)),
        speed=path / (max(int(moving.sum()), 1) / fps),
        steps=len(footfalls(joints, fps)),
        airborne=airborne(joints, fps),
    )


def footfalls(joints: Array, fps: float) -> list[int]:
    """Frames at which a foot is set on the floor after a swing of at least 12 cm and 0.1 s."""
    falls = []
    for foot in zip(ANKLES, TOES, strict=True):
        point = smooth_seconds(joints[:, foot].mean(axis=1), 0.04, fps)
        speed = np.linalg.norm(velocity(point, fps)[:, [0, 2]], axis=-1)
        threshold = max(0.35, 0.35 * float(np.percentile(speed, 90)))
        for a, b in runs(speed > threshold):
            swing = np.linalg.norm(point[b - 1, [0, 2]] - point[a, [0, 2]])
            if swing > 0.12 and b - a >= 0.1 * fps and b < len(joints):
                falls.append(b)
    return sorted(falls)


def airborne(joints: Array, fps: float) -> float:
    """Return the share of frames without a foot near the floor: both 3 cm above their standing height in the clip."""
    feet = joints[:, [*ANKLES, *TOES], 1] - np.array([0.06, 0.06, 0.0, 0.0])
    lowest = feet.min(axis=1)
    return float(np.mean(lowest > np.percentile(lowest, 3) + 0.03))


@dataclass(frozen=True)
class Hand:
    """Movement of one hand.

    Attributes:
        peak: highest wrist over the shoulder line, metres (negative: never over it).
        head: highest wrist over the head joint, metres.
        rise: highest wrist over where it hung when lowest, metres.
        lifted: seconds with the wrist clearly off the side of the body and at chest height or more.
        swings: half swings of the raised hand, across or up and down, of at least 7 cm (a wave has three or more).
        start, end: seconds of the longest lift; 0, 0 without one.
    """

    peak: float
    head: float
    rise: float
    lifted: float
    swings: int
    start: float
    end: float


def hand(joints: Array, fps: float, side: int) -> Hand:
    """Measure a hand; side 0 is the left one."""
    joints = np.asarray(joints, np.float64)
    wrist, shoulder = joints[:, WRISTS[side]], joints[:, SHOULDERS[side]]
    up = trunk_up(joints)
    over = np.einsum("ti,ti->t", wrist - joints[:, SHOULDERS[0]] / 2 - joints[:, SHOULDERS[1]] / 2, up)
    over = smooth_seconds(over, 0.05, fps)
    raised = over > -0.12
    stretches = runs(raised)
    longest = max(stretches, key=lambda ab: ab[1] - ab[0], default=(0, 0))
    return Hand(
        peak=float(over.max()),
        head=float((wrist[:, 1] - joints[:, HEAD, 1]).max()),
        rise=float(over.max() - over.min()),
        lifted=float(raised.sum() / fps),
        swings=_swings(joints, wrist, shoulder, raised, fps),
        start=longest[0] / fps,
        end=longest[1] / fps,
    )


def trunk_up(joints: Array) -> Array:
    """(T, 3) unit vectors from the pelvis to the neck."""
    up = joints[:, NECK] - joints[:, PELVIS]
    return up / np.maximum(np.linalg.norm(up, axis=-1, keepdims=True), 1e-9)


def _swings(joints: Array, wrist: Array, shoulder: Array, raised: NDArray[np.bool_], fps: float) -> int:
    """Half swings while the hand is up, along the direction in which it swings most."""
    local = np.stack([*body_frame(wrist - shoulder, heading(joints, fps)), wrist[:, 1] - shoulder[:, 1]], axis=-1)
    best = 0
    for a, b in runs(raised):
        if b - a < 0.3 * fps:
            continue
        part = local[a:b] - smooth_seconds(local[a:b], 0.6, fps)
        _, _, axes = np.linalg.svd(part - part.mean(axis=0), full_matrices=False)
        best = max(best, turning_points(smooth_seconds(local[a:b] @ axes[0], 0.03, fps), 0.07))
    return best


def swings(values: Array, smallest: float) -> list[int]:
    """Return the frames of the turning points of a signal (T,), those of moves under `smallest` left out."""
    found, direction, extreme, best = list[int](), 0, 0, float(values[0])
    for frame, value in enumerate(values.tolist()):
        if direction >= 0 and value < best - smallest:
            found.append(extreme)
            direction, extreme, best = -1, frame, value
        elif direction <= 0 and value > best + smallest:
            found.append(extreme)
            direction, extreme, best = 1, frame, value
        elif (value - best) * direction > 0:
            extreme, best = frame, value
    return [*found, extreme] if direction else found


def turning_points(values: Array, least: float) -> int:
    """Number of turning points of a signal (T,), ignoring moves smaller than `least`, its beginning not counted."""
    return max(len(swings(values, least)) - 1, 0)


def lean(joints: Array, fps: float) -> Array:
    """(T,) degrees by which the trunk leans forward (negative: backward), in the body's own heading."""
    up = smooth_seconds(trunk_up(np.asarray(joints, np.float64)), 0.08, fps)
    forward, _ = body_frame(up, heading(joints, fps))
    return np.degrees(np.arctan2(forward, up[:, 1]))
