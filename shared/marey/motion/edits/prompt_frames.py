"""Prompts of a motion with their first frames, as they follow changes of its time."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from marey.motion.clip import MotionClip
from marey.motion.resample import frame_times, resample

PROMPTS = "prompts"
"""Key of a manifest with the first frame of each prompt."""
NEAR = 1e-6
"""Frames: a time as near to the next frame counts as that frame."""


def prompts_of(clip: MotionClip) -> list[list[Any]]:
    """Return the prompts of a motion, each with its first frame; none of a captured one."""
    given: Any = clip.manifest.get(PROMPTS)
    if given:
        return [[frame, text] for frame, text in given]
    return [[0, clip.manifest["prompt"]]] if clip.manifest.get("prompt") else []


def without_repeats(prompts: Sequence[Sequence[Any]]) -> list[list[Any]]:
    """Return prompts without those that repeat the one before."""
    return [[frame, text] for k, (frame, text) in enumerate(prompts) if not k or text != prompts[k - 1][1]]


def with_prompts_at(manifest: Mapping[str, Any], times: Iterable[float]) -> dict[str, Any]:
    """Return a manifest whose prompts begin where their frames are now; unchanged if it has one prompt alone.

    Args:
        times: for each frame of the result, where it was in the source, counted in frames of the source.
    """
    given: Any = manifest.get(PROMPTS)
    if not given:
        return dict(manifest)
    firsts, texts = [first for first, _ in given], [text for _, text in given]
    told = [[frame, texts[max(bisect_right(firsts, time + NEAR) - 1, 0)]] for frame, time in enumerate(times)]
    return {**manifest, PROMPTS: without_repeats(told)}


def resampled(clip: MotionClip, fps: float) -> MotionClip:
    """Return a clip at another rate, with the first frames of its prompts.

    Raises:
        InvalidInput: a rate out of bounds.
    """
    if fps == clip.fps:
        return clip
    manifest = with_prompts_at(clip.manifest, frame_times(clip.frames, clip.fps, fps))
    return replace(resample(clip, fps), manifest=manifest)
