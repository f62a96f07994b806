"""The match of a motion in its quality record."""

from __future__ import annotations

import tomllib
from bisect import bisect_right
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from marey.motion.clip import MotionClip
from marey.motion.skeleton import HUMANML3D, Skeleton
from marey.quality.record import PromptMatch
from marey.selector.matching import Step, match, wanted_by_meaning, wanted_of
from marey.selector.motion import SHORTEST, Motion

FILE = Path(__file__).with_name("real_values.toml")
EVERY = slice(None)
PERCENT = 5
"""Percent between two quantiles of the table."""


def match_of(
    clip: MotionClip,
    sentences: Iterable[str],
    scope: Mapping[str, Any] | None = None,
    *,
    frames: slice = EVERY,
    winds: bool = False,
) -> PromptMatch:
    """Match a clip with its prompt, by its words or else by its meaning.

    Args:
        clip: the motion.
        sentences: as of `wanted_of`.
        scope: as of `wanted_by_meaning`.
        frames: those that show the prompt.
        winds: the prompt asks for a way that is not straight.
    """
    steps = wanted_of(sentences) or wanted_by_meaning(scope)
    if winds and steps:
        steps = tuple(tuple(replace(wanted, winds=True) for wanted in step) for step in steps)
    return match_steps(clip, steps, frames=frames)


def match_steps(clip: MotionClip, steps: Sequence[Step] | None, *, frames: slice = EVERY) -> PromptMatch:
    """Match a clip with actions in their order; the value is null without rules for them, on other skeletons than that
    of 22 joints, and under 8 frames."""
    value = match_joints(clip.joints[frames], clip.skeleton, clip.fps, steps)
    if not steps or value is None:
        return PromptMatch()
    single = steps[0][0].action if len(steps) == 1 and len(steps[0]) == 1 else None
    return PromptMatch(value=value, percentile=None if single is None else percentile(single, value))


def match_joints(
    joints: NDArray[np.floating], skeleton: Skeleton, fps: float, steps: Sequence[Step] | None
) -> float | None:
    """Match joints (T, J, 3), metres, with actions in their order, 0 to 1; None as of `match_steps`."""
    if not steps or skeleton.name != HUMANML3D.name or len(joints) < SHORTEST:
        return None
    return match(Motion(joints, fps), steps)


def percentile(action: str, value: float) -> int | None:
    """Return the percent of real clips of an action that match it no better than this; None without enough of them."""
    quantiles = real_values().get(action)
    return None if quantiles is None else max(PERCENT * (bisect_right(quantiles, value) - 1), 0)


@lru_cache(maxsize=1)
def real_values() -> Mapping[str, Sequence[float]]:
    """Return the quantiles of the values of real clips by action, from 0 to 100 percent; `marey.data.selector_values`
    writes them."""
    return tomllib.loads(FILE.read_text("utf-8"))["values"]
