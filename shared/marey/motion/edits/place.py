"""Place of a motion: facing +Z at the origin in frame 0. What was taken out stands in the manifest as `placement`."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from marey.motion.arrange import placement_of
from marey.motion.clip import MotionClip
from marey.motion.kinematics import facing
from marey.motion.rotations import Array, about, multiply, normalize, rotate

PLACEMENT = "placement"
NEAR, STRAIGHT = 5e-3, 0.035
"""Metres and radians (2 degrees) up to which frame 0 counts as at the origin and facing +Z: generated motions are no
nearer."""


def heading_of(clip: MotionClip, frame: int) -> float:
    """Return the angle about the vertical, from +Z, in which the body faces: radians, positive to its left.

    Without known hips and shoulders, it is the turn of the root.
    """
    if clip.skeleton.facing:
        x, _, z = facing(clip.joints[frame].astype(np.float64), clip.skeleton)
        return float(np.arctan2(x, z))
    w, _, y, _ = normalize(clip.rotations[frame, 0].astype(np.float64))
    return float(2 * np.arctan2(y, w))


def moved(clip: MotionClip, turn: Array, shift: Array) -> MotionClip:
    """Return the clip turned about the vertical axis of the origin, then moved.

    Args:
        turn: (4,) quaternion about Y.
        shift: (3,) metres.
    """
    rotations = clip.rotations.astype(np.float64)
    rotations[:, 0] = multiply(turn, rotations[:, 0])
    root = rotate(turn, clip.root.astype(np.float64)) + shift
    return posed(clip, rotations, root)


def raised(clip: MotionClip, metres: float) -> MotionClip:
    """Return the clip at another height; the same one where that is 0."""
    return moved(clip, about("Y", 0.0), np.array([0.0, metres, 0.0])) if metres else clip


def posed(clip: MotionClip, rotations: Array, root: Array, **changes: Any) -> MotionClip:
    """Return the clip with other poses, without features; its joints follow.

    Args:
        rotations: (T, J, 4) local quaternions.
        root: (T, 3) metres.
        changes: other fields of the clip.
    """
    plain = replace(clip, **changes)
    return MotionClip.of(plain.skeleton, rotations, root, plain.contacts, plain.fps, manifest=plain.manifest)


def at_origin(clip: MotionClip) -> MotionClip:
    """Return the clip facing +Z at the origin in frame 0; its manifest says where it was.

    A clip whose own place is there, nearly, is put back to it exactly: reversed twice, a motion is the same again.

    Raises:
        InvalidInput: the placement in its manifest cannot be read.
    """
    turn, shift = placement_of(clip)
    before = float(2 * np.arctan2(turn[2], turn[0]))
    angle, at = heading_of(clip, 0), clip.root[0].astype(np.float64) * np.array([1.0, 0.0, 1.0])
    place, heading = rotate(turn, at) + shift, np.arctan2(np.sin(before + angle), np.cos(before + angle))
    manifest = {name: value for name, value in clip.manifest.items() if name != PLACEMENT}
    if abs(heading) <= STRAIGHT and np.linalg.norm(place) <= NEAR:
        return clip if PLACEMENT not in clip.manifest else replace(moved(clip, turn, shift), manifest=manifest)
    back = about("Y", -angle)
    manifest[PLACEMENT] = placement(place[0], place[2], heading)
    return replace(moved(clip, back, -rotate(back, at)), manifest=manifest)


def placement(x: float, z: float, heading: float) -> dict[str, float]:
    """Return the record of a placement: metres and radians."""
    values = {"x": (x, 7), "z": (z, 7), "heading": (heading, 8)}
    return {name: round(float(value), digits) + 0.0 for name, (value, digits) in values.items()}
