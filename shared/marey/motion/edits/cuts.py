"""Cuts in time: `trim`. `split` is two trims."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from marey.core.errors import InvalidInput
from marey.motion.clip import MotionClip
from marey.motion.edits.operation import frame_number
from marey.motion.edits.place import posed
from marey.motion.edits.prompt_frames import with_prompts_at
from marey.motion.edits.timeline_rows import cut_rows


def trim(clip: MotionClip, values: Mapping[str, Any]) -> MotionClip:
    """Keep the frames between two moments, both included.

    Raises:
        InvalidInput: a moment is outside the motion, or the second is before the first.
    """
    first, last = frames_of(clip, values["from"], values["to"])
    told = cut_rows(clip.manifest, first, last, clip.fps)
    return replace(part(clip, first, last), manifest=with_prompts_at(told, range(first, last + 1)))


def frames_of(clip: MotionClip, start: float | str, end: float | str | None) -> tuple[int, int]:
    """Return the frames of two moments, the last frame where the second is None.

    Raises:
        InvalidInput: a moment is outside the motion, or the second is before the first.
    """
    first = _frame(start, clip)
    last = clip.frames - 1 if end is None else _frame(end, clip)
    if last < first:
        raise InvalidInput(f"the end, frame {last}, is before the beginning, frame {first}")
    return first, last


def part(clip: MotionClip, first: int, last: int) -> MotionClip:
    """Return the frames from `first` to `last`, both included, without features."""
    kept = slice(first, last + 1)
    return posed(clip, clip.rotations[kept], clip.root[kept], contacts=clip.contacts[kept])


def _frame(moment: float | str, clip: MotionClip) -> int:
    frame = frame_number(moment, clip.fps)
    if frame >= clip.frames:
        given = moment if isinstance(moment, str) else f"{moment:g} s"
        raise InvalidInput(
            f"{given} is after the end of the motion",
            hint=f"It has {clip.frames} frames, 0 to {clip.frames - 1}, at {clip.fps:g} a second: "
            f"to {(clip.frames - 1) / clip.fps:.3f} s.",
        )
    return frame
