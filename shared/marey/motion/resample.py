"""Motion at another frame rate."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from marey.core.errors import InvalidInput
from marey.core.frame_rates import frames_at_rate
from marey.motion.clip import MotionClip
from marey.motion.kinematics import forward_kinematics
from marey.motion.rotations import Array, normalize, unroll

SLOWEST, FASTEST = 1.0, 240.0  # frames a second; film and games use 23.976 to 120


def frame_times(frames: int, fps: float, to: float) -> Array:
    """Return the positions of the new rate's frames, counted in frames of the old rate, from the first to the last.

    Raises:
        InvalidInput: a rate out of bounds.
    """
    if not SLOWEST <= to <= FASTEST:
        raise InvalidInput(f"{to:g} frames a second; allowed: {SLOWEST:g} to {FASTEST:g}")
    return np.minimum(np.arange(frames_at_rate(frames, fps, to)) * (fps / to), frames - 1)


def interpolate(values: Array, times: Array) -> Array:
    """Interpolate (T, ...) over axis 0 by Catmull-Rom splines: through every value, with continuous speed."""
    last = len(values) - 1
    at = np.minimum(times.astype(np.intp), max(last - 1, 0))
    t = (times - at).reshape(-1, *[1] * (values.ndim - 1))
    a, b = values[at], values[np.minimum(at + 1, last)]
    # Beyond the clip the motion continues: values mirrored at the end.
    before = np.where(_like(at == 0, t), 2 * a - b, values[np.maximum(at - 1, 0)])
    after = np.where(_like(at + 2 > last, t), 2 * b - a, values[np.minimum(at + 2, last)])
    slope_a, slope_b = (b - before) / 2, (after - a) / 2
    return (
        (2 * t**3 - 3 * t**2 + 1) * a
        + (t**3 - 2 * t**2 + t) * slope_a
        + (3 * t**2 - 2 * t**3) * b
        + (t**3 - t**2) * slope_b
    )


def _like(mask: NDArray[np.bool_], t: Array) -> NDArray[np.bool_]:
    return mask.reshape(t.shape)


def interpolate_rotations(rotations: Array, times: Array) -> Array:
    """Interpolate unit quaternions (T, ..., 4) at other times, with continuous angular speed.

    Signs are made continuous, then components follow Catmull-Rom splines and are normalised. Between neighbouring
    frames (up to 40 degrees apart) this is within 0.1 degree of spherical interpolation where that is steady, and
    unlike it has no jerk at every old frame.
    """
    return normalize(interpolate(unroll(np.asarray(rotations, np.float64)), times))


def resample(clip: MotionClip, fps: float) -> MotionClip:
    """Resample a clip to another rate; features stay as generated.

    Raises:
        InvalidInput: a rate out of bounds.
    """
    if fps == clip.fps:
        return clip
    times = frame_times(clip.frames, clip.fps, fps)
    rotations = interpolate_rotations(clip.rotations, times).astype(np.float32)
    root = interpolate(clip.root.astype(np.float64), times).astype(np.float32)
    return replace(
        clip,
        rotations=rotations,
        root=root,
        joints=forward_kinematics(clip.skeleton, rotations, root).astype(np.float32),
        contacts=clip.contacts[np.rint(times).astype(np.intp)],
        fps=float(fps),
    )
