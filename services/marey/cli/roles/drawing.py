"""Motions of prepared folders, and difficulty of tokens, for `marey render`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from marey.core.errors import InvalidInput
from marey.core.extras import extra
from marey.registry import find_model, models_with, resolve

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from marey.motion.clip import MotionClip
    from marey.motion.features import FeatureLayout
    from marey.viz.difficulty import TokenDifficulty


def prepared_clip(folder: Path, number: int) -> MotionClip:
    """Return a clip of a prepared folder, with its first caption as the prompt.

    Raises:
        InvalidInput: there is no such clip.
        NotFound, InvalidFile: no prepared folder, or a damaged one.
    """
    with extra("train"):
        from marey.data.prepared import PreparedData
        from marey.motion.finish import finish_motion
    data = PreparedData.open(folder)
    if not 0 <= number < len(data.clips):
        raise InvalidInput(
            f"there is no clip {number}", where=str(folder), hint=f"It has clips 0 to {len(data.clips) - 1}."
        )
    clip = data.clips[number]
    manifest = {"prompt": clip.captions[0]} if clip.captions else {}
    return finish_motion(data.features(clip), data.layout, manifest=manifest)


def difficulties_of(bundle: str, clips: Sequence[MotionClip], names: Sequence[str]) -> list[TokenDifficulty]:
    """Return the difficulty of each clip's tokens for a bundle's model, under the prompt in the clip's manifest.

    Args:
        bundle: name or path.
        clips: with features of the bundle's layout, or on its skeleton and at its rate.
        names: of the clips, for errors.

    Raises:
        InvalidInput: the model does not know difficulty, or a clip has no prompt or no features for it.
    """
    with extra("worker"):
        from marey.bundles import choose_bundle
        from marey.bundles.body import layout_of
    found = choose_bundle(bundle)
    spec = find_model(found.manifest.model)
    if spec is None or spec.difficulty is None:
        raise InvalidInput(
            f"the model {found.manifest.model!r} does not predict which tokens are hard",
            where=bundle,
            hint=f"Models that do: {', '.join(models_with('difficulty')) or 'none'}.",
        )
    space = layout_of(found.manifest)
    motions = [_features(clip, space, name) for clip, name in zip(clips, names, strict=True)]
    prompts = [_prompt(clip, name) for clip, name in zip(clips, names, strict=True)]
    with extra("worker"):
        difficulty = resolve(spec.difficulty)
    return difficulty(found, motions, prompts)


def _prompt(clip: MotionClip, name: str) -> str:
    prompt = clip.manifest.get("prompt")
    if not prompt:
        raise InvalidInput(
            "has no prompt", where=name, hint="Difficulty depends on it: render a generated .npz or a prepared clip."
        )
    return str(prompt)


def _features(clip: MotionClip, space: FeatureLayout, name: str) -> NDArray[np.float32]:
    if clip.features.shape[1] == space.dim and clip.features_fps == space.fps:
        return clip.features
    raise InvalidInput(
        f"has no features of {space.name} at {space.fps:g} fps",
        where=name,
        hint="Render a .npz that the bundle's model generated, or a clip of a prepared folder with --clip.",
    )
