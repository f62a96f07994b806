"""Load an evaluator of any kind from its bundle."""

from __future__ import annotations

from pathlib import Path

from marey.bundles import Bundle, find_bundle
from marey.core.errors import InvalidBundle
from marey.data.prepared import PreparedData
from marey.evaluator.port import Evaluator


def load_evaluator(
    bundle: Bundle | str, *, device: str = "auto", captions: Path | PreparedData | None = None
) -> Evaluator:
    """Load a bundle of kind `evaluator`.

    Args:
        bundle: a verified bundle, or its name or path.
        device: `auto`, `cpu`, `cuda`, `cuda:N`.
        captions: HumanML3D's folder of caption files, or its prepared data; needed for text by the public T2M
            evaluator alone, which reads words with part-of-speech tags.

    Raises:
        NotFound, InvalidBundle, Refused: see `find_bundle` and the evaluators' `load`.
        InvalidInput: unknown device.
    """
    verified = find_bundle(bundle) if isinstance(bundle, str) else bundle
    manifest = verified.manifest
    if manifest.kind == "evaluator" and manifest.model == "tmr":
        from marey.evaluator.tmr import TMREvaluator

        return TMREvaluator.load(verified, device=device)
    if manifest.kind == "evaluator" and manifest.model == "tmr-published":
        from marey.evaluator.tmr_published import PublishedTMREvaluator

        return PublishedTMREvaluator.load(verified, device=device)
    if manifest.kind == "evaluator" and manifest.model == "snapmogen":
        from marey.evaluator.snapmogen import SnapMoGenEvaluator

        return SnapMoGenEvaluator.load(verified, device=device)
    if manifest.kind == "evaluator" and manifest.model == "t2m":
        from marey.evaluator.t2m import T2MEvaluator
        from marey.evaluator.t2m_words import TaggedCaptions

        tagger = None
        if captions is not None:
            tagger = TaggedCaptions.read(captions) if isinstance(captions, Path) else TaggedCaptions.of(captions)
        return T2MEvaluator.load(verified, device=device, tagger=tagger)
    raise InvalidBundle(
        f"is a {manifest.kind} of {manifest.model}, not an evaluator that this version reads", where=str(verified.path)
    )
