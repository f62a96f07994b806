"""Operations on time: speed, direction, frame rate."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, cast

import numpy as np

from marey.core.errors import InvalidInput
from marey.motion.clip import MotionClip
from marey.motion.edits.operation import MOST_FRAMES
from marey.motion.edits.place import posed
from marey.motion.edits.prompt_frames import with_prompts_at
from marey.motion.edits.timeline_rows import ROUNDING, faster_rows, frames_at_speed, reversed_rows
from marey.motion.resample import frame_times, interpolate, interpolate_rotations
from marey.motion.rotations import Array


def change_speed(clip: MotionClip, values: Mapping[str, Any]) -> MotionClip:
    """Play `factor` times as fast at the same frame rate: frames between those of the source are interpolated.

    Raises:
        InvalidInput: the motion is an open loop, or the result would have too many frames.
    """
    factor = values["factor"]
    if abs(factor - 1.0) < 1e-12:
        return clip
    _limited((clip.frames - 1) / factor)
    times = np.minimum(np.arange(frames_at_speed(clip.frames, factor)) * factor, clip.frames - 1)
    manifest = dict(clip.manifest)
    if "loop" in manifest:
        times = _whole(clip, (clip.frames - 1) / factor)
        record = cast("dict[str, Any]", manifest["loop"])
        seconds = (len(times) - 1) / clip.fps
        manifest["loop"] = {**record, "cycle": {**record["cycle"], "seconds": round(seconds, 6)}}
    manifest = faster_rows(manifest, factor, clip.frames, len(times), clip.fps)
    return _at(clip, times, clip.fps, manifest)


def reverse(clip: MotionClip, values: Mapping[str, Any]) -> MotionClip:
    """Play backwards."""
    told = reversed_rows(clip.manifest, clip.frames, clip.fps)
    manifest = with_prompts_at(told, reversed(range(clip.frames)))
    return posed(clip, clip.rotations[::-1], clip.root[::-1], contacts=clip.contacts[::-1], manifest=manifest)


def change_rate(clip: MotionClip, values: Mapping[str, Any]) -> MotionClip:
    """Resample to another frame rate; the last frame of a loop stays its last, so its length may change by half a
    frame.

    Raises:
        InvalidInput: a rate out of bounds, the motion is an open loop, or the result would have too many frames.
    """
    rate = values["rate"]
    if rate == clip.fps:
        return clip
    _limited((clip.frames - 1) * rate / clip.fps)
    times = frame_times(clip.frames, clip.fps, rate)
    if "loop" in clip.manifest:
        times = _whole(clip, (clip.frames - 1) * rate / clip.fps)
    return _at(clip, times, rate, clip.manifest)


def _limited(intervals: float) -> None:
    """Raise InvalidInput for too many intervals between frames; nothing was computed yet."""
    count = int(intervals + ROUNDING)
    if count >= MOST_FRAMES:
        raise InvalidInput(f"the result would have {count + 1:.4g} frames; the most is {MOST_FRAMES}")


def _whole(clip: MotionClip, intervals: float) -> Array:
    """Return the times of a closed loop with a whole number of frames between its first and its last."""
    if cast("Mapping[str, Any]", clip.manifest["loop"])["end"] != "closed":
        raise InvalidInput(
            "the time of an open loop cannot be changed: the frame after its last one is missing",
            hint="Do it before the loop is made, or make a closed loop.",
        )
    return np.linspace(0.0, clip.frames - 1, max(round(intervals), 1) + 1)


def _at(clip: MotionClip, times: Array, fps: float, manifest: Mapping[str, Any]) -> MotionClip:
    """Return the clip at other times, counted in its frames."""
    return posed(
        clip,
        interpolate_rotations(clip.rotations, times),
        interpolate(clip.root.astype(np.float64), times),
        contacts=clip.contacts[np.rint(times).astype(np.intp)],
        fps=fps,
        manifest=with_prompts_at(manifest, times),
    )
