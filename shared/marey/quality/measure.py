"""Physical measures of a motion of the 22 joints of HumanML3D, without labels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from marey.core.errors import InvalidInput
from marey.motion.capsules import CAPSULES, SIDES, segment_distance
from marey.motion.feet import runs
from marey.motion.resample import frame_times, interpolate
from marey.motion.skeleton import HUMANML3D
from marey.motion.support import RADII

Array = NDArray[np.float64]

FLOAT_HEIGHT = 0.08
"""Metres over its resting height from which a joint does not rest."""
LOW = 0.05
"""Metres over its resting height up to which a joint of a foot touches the floor."""
NEAR = 0.08
"""The same for a joint that carries the body while another one of the feet is lower."""
SKATE_SPEED = 0.5
"""Metres a second from which a joint of a foot does not stand."""
POP_FPS = 20.0
"""A pop is measured at this rate, so that it counts the same at any rate of the clip."""
POP_STEP = 0.16
"""Metres that a joint moves in one frame beyond `POP_RATIO` times its faster neighbouring step."""
POP_RATIO = 3.0
AT_ONCE = 256
"""Frames whose capsules are measured together, so that the memory does not grow with the length of a motion."""
SHORTEST = 4
"""Frames of the shortest clip that is measured."""

_J = {name: j for j, name in enumerate(HUMANML3D.joint_names)}
_FEET = list(HUMANML3D.feet)
_LEGS = [[_J[f"{side}{part}"] for side in SIDES] for part in ("hip", "knee", "ankle", "foot")]

# Farthest inner angles between bones, degrees: 0 = straight. Joint, joint before, joint after.
_BENDS = (
    *((f"{s}hip", f"{s}knee", f"{s}ankle", 155.0) for s in SIDES),
    *((f"{s}shoulder", f"{s}elbow", f"{s}wrist", 155.0) for s in SIDES),
    ("pelvis", "spine2", "spine3", 60.0),
    ("spine3", "neck", "head", 90.0),
)
_BEND_JOINTS = np.array([[_J[a], _J[b], _J[c]] for a, b, c, _ in _BENDS])
_BEND_LIMITS = np.array([limit for *_, limit in _BENDS])
_KNEE_BACK = 10.0
"""Degrees that a knee may bend backwards."""

# Neighbours along the body always overlap and are left out.
_PAIRS = (
    ("L_forearm", "R_forearm"),
    ("L_shin", "R_shin"),
    ("L_thigh", "R_shin"),
    ("L_shin", "R_thigh"),
    *((f"{s}forearm", other) for s in SIDES for other in ("trunk", "head", "L_thigh", "R_thigh", "L_shin", "R_shin")),
    *((f"{s}shin", other) for s in SIDES for other in ("trunk", "head")),
)


def _ends(side: int) -> tuple[list[int], list[int]]:
    capsules = [CAPSULES[pair[side]] for pair in _PAIRS]
    return [_J[begin] for begin, _, _ in capsules], [_J[end] for _, end, _ in capsules]


_FIRST, _SECOND = _ends(0), _ends(1)
_REACH = np.array([CAPSULES[a][2] + CAPSULES[b][2] for a, b in _PAIRS])


@dataclass(frozen=True)
class Measures:
    """Measures of one motion; `marey.quality.record.MotionQuality` documents each."""

    float_s: float
    skate: float
    penetration_mm: float
    pops: int
    range_deg: float
    self_contact: float


def check_joints(joints: NDArray[np.floating], shortest: int, *, where: str) -> NDArray[np.float64]:
    """Return joints (T >= `shortest`, 22, 3) in double precision.

    Raises:
        InvalidInput: another shape, or numbers that are not finite.
    """
    joints = np.asarray(joints, np.float64)
    if joints.ndim != 3 or joints.shape[1:] != (len(HUMANML3D), 3) or len(joints) < shortest:
        wanted = f"(T >= {shortest}, {len(HUMANML3D)}, 3)"
        raise InvalidInput(f"joints have shape {joints.shape}, not {wanted}", where=where)
    if not np.isfinite(joints).all():
        raise InvalidInput("joints hold numbers that are not finite", where=where)
    return joints


def measure(joints: NDArray[np.floating], fps: float) -> Measures:
    """Measure a motion.

    Args:
        joints: (T >= 4, 22, 3) metres, Y up, the floor at y = 0.
        fps: frames a second.

    Raises:
        InvalidInput: another shape, or numbers that are not finite.
    """
    joints = check_joints(joints, SHORTEST, where="quality")
    return Measures(
        float_s=round(float_seconds(joints, fps), 3),
        skate=round(skate(joints, fps), 4),
        penetration_mm=round(1000 * penetration(joints), 1),
        pops=pops(joints, fps),
        range_deg=round(range_degrees(joints), 1),
        self_contact=round(1000 * self_contact(joints), 1),
    )


def float_seconds(joints: Array, fps: float) -> float:
    """Return the longest time in seconds with every joint over `FLOAT_HEIGHT` above its resting height."""
    height = (joints[..., 1] - RADII).min(axis=1)
    return max((end - begin for begin, end in runs(height > FLOAT_HEIGHT)), default=0) / fps


def skate(joints: Array, fps: float) -> float:
    """Return the share of frames in which feet touch the floor and none of their joints stands.

    A swinging foot that passes low does not count while the other foot stands.
    """
    feet = joints[:, _FEET]
    height = feet[..., 1] - RADII[_FEET]
    height = np.minimum(height[1:], height[:-1])
    slow = np.linalg.norm(np.diff(feet, axis=0), axis=-1) * fps < SKATE_SPEED
    return float(((height < LOW).any(axis=1) & ~(slow & (height < NEAR)).any(axis=1)).mean())


def penetration(joints: Array) -> float:
    """Return the depth in metres of the deepest joint under the floor, 0 or more."""
    return float(max(0.0, -joints[..., 1].min()))


def pops(joints: Array, fps: float) -> int:
    """Return the number of frames in which a joint jumps: it goes far, and it rests or is slow before and after."""
    if fps != POP_FPS:
        joints = np.asarray(interpolate(joints, frame_times(len(joints), fps, POP_FPS)), np.float64)
    steps = np.linalg.norm(np.diff(joints, axis=0), axis=-1)
    padded = np.pad(steps, ((1, 1), (0, 0)), mode="edge")  # no pop at the ends of a clip
    around = np.maximum(padded[:-2], padded[2:])
    return int((steps - POP_RATIO * around > POP_STEP).any(axis=1).sum())


def range_degrees(joints: Array) -> float:
    """Return how far a joint bends beyond its range at most, degrees, 0 or more."""
    before, at, after = (joints[:, _BEND_JOINTS[:, k]] for k in range(3))
    beyond = _angles(at - before, after - at) - _BEND_LIMITS
    return float(max(0.0, beyond.max(), _knees_back(joints) - _KNEE_BACK))


def _knees_back(joints: Array) -> float:
    """Return the farthest that a knee bends away from its toes, degrees, 0 or more.

    Both turn about the same axis: the knee's bend about thigh x shin, the foot's rise about toes x shin. A foot that
    points along its shin says nothing.
    """
    hip, knee, ankle, toe = (joints[:, side] for side in _LEGS)
    thigh, shin, foot = knee - hip, ankle - knee, toe - ankle
    hinge, lateral = np.cross(thigh, shin), np.cross(foot, shin)
    pointed = np.abs(_angles(foot, shin) - 90) > 50
    opposed = _angles(hinge, lateral) > 120
    return float(np.where(opposed & ~pointed, _angles(thigh, shin), 0.0).max())


def _angles(a: Array, b: Array) -> Array:
    """Return the angles between vectors (..., 3), degrees."""
    norms = np.linalg.norm(a, axis=-1) * np.linalg.norm(b, axis=-1)
    return np.degrees(np.arccos(np.clip((a * b).sum(axis=-1) / np.maximum(norms, 1e-12), -1, 1)))


def self_contact(joints: Array) -> float:
    """Return the deepest that two capsules of the body pass into each other, metres, 0 or more."""
    parts = (joints[first : first + AT_ONCE] for first in range(0, len(joints), AT_ONCE))
    distances = (segment_distance(*(part[:, ends] for ends in (*_FIRST, *_SECOND))) for part in parts)
    return float(max((_REACH - distance).max() for distance in distances).clip(0.0))
