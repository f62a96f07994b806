"""Poses that are held as long as the words say, where a drawn movement is farthest from how it begins."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from marey.motion.features import FeatureLayout, encode_all
from marey.motion.filters import smooth_seconds
from marey.posing.standing import poses_at

Float32 = NDArray[np.float32]
Array = NDArray[np.floating]

HOLDING = frozenset(
    {"squat", "bow", "bend-over", "raise-arm", "reach-up", "reach-forward", "pick-up", "crouch", "balance"}
)
"""Actions with a pose that can be held."""
NEAR = 0.15
"""Share of the way to the farthest pose by which one differs from it and is as good."""
EASES_S = 0.06
"""Standard deviation of the filter by which a body comes to the pose and leaves it, seconds."""


def with_held_pose(features: Float32, layout: FeatureLayout, seconds: float) -> Float32:
    """Return a motion (T', D) that stays in its farthest pose for so many seconds; as it is if it does so already.

    Args:
        features: (T, D), in the layout's own units.
        layout: of them, on the skeleton of HumanML3D.
        seconds: for which the pose is held.
    """
    joints = layout.decode(features).astype(np.float64)
    at, away = _farthest(joints)
    alike = np.linalg.norm(joints - joints[at], axis=-1).mean(axis=1) < NEAR * away
    more = round(seconds * layout.fps) - int(alike.sum())
    return encode_all(layout, _held(joints, at, more, layout.fps)) if more > 0 else features


def with_frames_held(joints: Array, frames: int, fps: float) -> Array:
    """Return joints (frames, 22, 3) that stay in their farthest pose until there are so many; as they are if there are
    already.

    Args:
        joints: (T, 22, 3) metres, Y up.
        frames: that there are to be.
        fps: of the joints.
    """
    return _held(joints, _farthest(joints)[0], frames - len(joints), fps) if frames > len(joints) else joints


def _farthest(joints: Array) -> tuple[int, float]:
    """Return the frame whose pose differs most from the first, and by how many metres it does."""
    away = np.linalg.norm(joints - joints[:1], axis=-1).mean(axis=1)
    return int(away.argmax()), float(away.max())


def _held(joints: Array, at: int, more: int, fps: float) -> Array:
    """Return joints that stay in the pose of a frame for so many frames more."""
    index = np.concatenate([np.arange(at), np.full(more, at), np.arange(at, len(joints))]).astype(float)
    index[1:-1] = smooth_seconds(index, EASES_S, fps)[1:-1]
    return poses_at(joints, index)
