"""Quality record of an edited motion, made anew: of the frames that it has, by the prompt in its manifest."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, cast

import numpy as np

from marey.core.errors import InvalidInput
from marey.motion.clip import QUALITY, MotionClip
from marey.motion.edits.prompt_frames import prompts_of
from marey.quality.clips import quality_of
from marey.quality.limits import expected_by_prompts
from marey.quality.postures import posture_jumps
from marey.quality.record import Flag, PromptMatch
from marey.selector.records import match_of
from marey.text.actions import split_actions
from marey.text.graph import SemanticGraph

STAYS = 1e-3
"""Metres on the floor within which the root of a motion in place stays."""


def judged(clip: MotionClip) -> MotionClip:
    """Return the clip with a quality record in its manifest; without one on skeletons that are not measured.

    Feet of a motion whose travel was removed slide by intention: it is not flagged for that.
    """
    about = clip.manifest
    quality = quality_of(clip, expected_by_prompts([str(text) for _, text in prompts_of(clip)]))
    if quality is None:
        return clip
    if "travel" in about and np.ptp(clip.root[:, [0, 2]], axis=0).max() < STAYS:
        quality = quality.model_copy(update={"flags": [flag for flag in quality.flags if flag is not Flag.SKATING]})
    quality = quality.with_match(_match(clip))
    if posture_jumps(clip):
        quality = quality.with_posture_jump()
    return replace(clip, manifest={**about, QUALITY: quality.model_dump(mode="json")})


def _match(clip: MotionClip) -> PromptMatch:
    """Match a clip with its prompt; a motion with several prompts has no match, as a recorded stream has none."""
    about = clip.manifest
    if about.get("prompts") or not about.get("prompt"):
        return PromptMatch()
    scope = cast("Mapping[str, Any] | None", about.get("scope"))
    return match_of(clip, _actions(about), scope)


def _actions(manifest: Mapping[str, Any]) -> Sequence[str]:
    """Return the actions of the prompt in order of time; the whole prompt where its graph is missing or broken."""
    text = str(manifest.get("rewritten") or manifest["prompt"])
    try:
        return split_actions(SemanticGraph.from_json(manifest["graph"]))
    except (KeyError, TypeError, ValueError, InvalidInput):
        return (text,)
