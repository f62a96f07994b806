"""The prompts of an evaluator's bundle: captions of the real clips in its reference. The embeddings of their motions
are stored beside them and read by the evaluator."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, cast

from marey.bundles.bundle import Bundle
from marey.core.errors import InvalidBundle, InvalidInput, MareyError
from marey.items.evaluation_prompts import EvaluationPrompt, read_prompts
from marey.items.expected import read_expected

FILE, PART = "reference.json", "reference"


def reference_prompts(bundle: Bundle, split: str) -> tuple[EvaluationPrompt, ...]:
    """Return one prompt per clip of a split, in the order of the file, as long as the clip.

    A clip has several captions; clip n gives its n-th, modulo their number, so that all phrasings occur.

    Raises:
        InvalidBundle: it holds no such prompts, broken ones, prompts without the embedding of their motion, or too few
            or too many for an evaluation.
    """
    if FILE not in bundle.manifest.files:
        raise InvalidBundle(
            f"{bundle.manifest.name} carries no captions of real clips, which every report compares with",
            where=str(bundle.path),
            hint="`marey train evaluator reference` writes it again with them.",
        )
    document = bundle.read_json(FILE)
    fps = bundle.manifest.fps
    if not isinstance(document, dict) or split not in document or not fps:
        raise InvalidBundle(
            f"{bundle.manifest.name} carries no captions of the split {split!r}", where=str(bundle.path)
        )
    clips = cast("list[Mapping[str, Any]]", document[split])
    _check_motions(bundle, split, len(clips))
    try:
        rows = [(number + 1, _row(clip, number, fps)) for number, clip in enumerate(clips)]
    except (LookupError, TypeError, ValueError, ZeroDivisionError) as error:
        raise InvalidBundle(
            f"the captions of {bundle.manifest.name} cannot be read: {_why(error)}", where=str(bundle.path / FILE)
        ) from error
    try:
        return read_prompts(rows, where=str(bundle.path / FILE))
    except MareyError as error:
        raise InvalidBundle(str(error), where=str(bundle.path / FILE)) from error


def _check_motions(bundle: Bundle, split: str, clips: int) -> None:
    """Refuse captions whose motions have no embedding in the bundle, before anything is generated for them."""
    if PART not in bundle.manifest.parts:
        return  # reported when the network is loaded
    known = bundle.tensors(PART, dtype=None).get(split)
    if known is None or len(known) != clips:
        raise InvalidBundle(
            f"{bundle.manifest.name} has captions of {clips} clips of the split {split!r} and embeddings of "
            f"{0 if known is None else len(known)} motions",
            where=str(bundle.path),
            hint="`marey train evaluator reference` writes both again.",
        )


def _row(clip: Mapping[str, Any], number: int, fps: float) -> dict[str, Any]:
    captions = clip["captions"]
    if not captions:
        raise ValueError(f"clip {clip['id']} has none")
    return {
        "prompt": captions[number % len(captions)],
        "seconds": int(clip["frames"]) / fps,
        "expected": expected_of(clip["acts"], clip["sides"]),
    }


def _why(error: Exception) -> str:
    """Return the reason of an error whose type alone does not state it."""
    return str(error) if isinstance(error, ValueError | TypeError) else repr(error)


def expected_of(acts: Sequence[str], sides: Sequence[str]) -> str | None:
    """Return the actions of a clip as expectations for the checker; None for content without a check (a dance step)."""
    text = " then ".join(" ".join(filter(None, pair)) for pair in zip(acts, sides, strict=True))
    try:
        read_expected(text)
    except InvalidInput:
        return None
    return text
