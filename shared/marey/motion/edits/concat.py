"""One motion after another: the second begins at the last pose of the first, and their difference fades."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from marey.core.errors import InvalidInput
from marey.motion.clip import MotionClip
from marey.motion.edits.joining import faded_in, placed_after
from marey.motion.edits.place import posed
from marey.motion.edits.prompt_frames import PROMPTS, prompts_of, resampled, without_repeats
from marey.motion.edits.prompts import READ_PROMPT, joined

SAME_BONES = 1e-4
"""Metres."""


def concat(clip: MotionClip, values: Mapping[str, Any]) -> MotionClip:
    """Let another motion follow: n + m - 1 frames, since its first pose is the last of the clip.

    Args:
        values: `with`, the other motion, and `blend`, the seconds of the fading.

    Raises:
        InvalidInput: the skeletons differ.
    """
    second = values["with"]
    check_bodies(clip, second)
    second = placed_after(clip, resampled(second, clip.fps))
    rotations, root = faded_in(clip, second, round(values["blend"] * clip.fps))
    return posed(
        clip,
        np.concatenate([clip.rotations.astype(np.float64), rotations[1:]]),
        np.concatenate([clip.root.astype(np.float64), root[1:]]),
        contacts=np.concatenate([clip.contacts, second.contacts[1:]]),
        manifest=joined_prompts(clip, second),
    )


def joined_prompts(clip: MotionClip, second: MotionClip) -> dict[str, Any]:
    """Return the clip's manifest with the prompts of both, each with its first frame, where they differ."""
    both = joined(clip.manifest.get("prompt", ""), second.manifest.get("prompt", ""))
    later = [[frame + clip.frames - 1, text] for frame, text in prompts_of(second)]
    return with_prompts(clip.manifest, both, [*prompts_of(clip), *later])


def with_prompts(manifest: Mapping[str, Any], prompt: str, prompts: Sequence[Sequence[Any]]) -> dict[str, Any]:
    """Return a manifest with other prompts, each with its first frame; unchanged if the prompt is the same.

    What was read in the first prompt alone is left out.
    """
    if prompt == manifest.get("prompt", ""):
        return dict(manifest)
    kept = {name: value for name, value in manifest.items() if name not in (*READ_PROMPT, PROMPTS)}
    several = without_repeats(prompts)
    return {**kept, "prompt": prompt, **({PROMPTS: several} if len(several) > 1 else {})}


def check_bodies(clip: MotionClip, second: MotionClip) -> None:
    """Check that two motions have one skeleton with equal bones. Raises InvalidInput."""
    ours, theirs = clip.skeleton, second.skeleton
    if ours.joint_names != theirs.joint_names or ours.parents != theirs.parents:
        raise InvalidInput("the motions have different skeletons", hint="Join motions of one skeleton.")
    apart = float(np.abs(ours.offsets[1:] - theirs.offsets[1:]).max(initial=0.0))
    if apart > SAME_BONES:
        raise InvalidInput(
            f"the bodies differ: a bone ends {1000 * apart:.1f} mm apart",
            hint="Generate both motions with one body.",
        )
