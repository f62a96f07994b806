"""Assembly of an evaluator bundle from the trained part of a run."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from torch import Tensor

from marey.bundles import Bundle
from marey.core.errors import InvalidInput
from marey.data.prepared import PreparedData
from marey.evaluator.bundle import load_networks, write_bundle
from marey.evaluator.card import card_of
from marey.evaluator.config import EvaluatorConfig
from marey.evaluator.model import TMR, MotionEncoder
from marey.evaluator.reference import SPLITS, RealClips, ReferenceClip, ReferenceSplit
from marey.evaluator.sentences import open_encoder, spec_of
from marey.evaluator.tmr import embed_motions
from marey.training.assembly import gather
from marey.training.staging import TrainingRecipe

RECIPE = TrainingRecipe(
    read=EvaluatorConfig.from_dict,
    built_from={"tmr": ("layout", "features", "inputs", "frames_per_token", "max_frames", "text_width", "network")},
    shares={"tmr": 1.0},
)


def assemble(
    prepared: Path,
    run: Path,
    bundle: Path,
    config: EvaluatorConfig,
    *,
    card: str | None = None,
    overwrite: bool = False,
) -> Bundle:
    """Write the bundle from the part of a run, with a reference of the data's validation and test clips.

    Without `card` the card is generated from the metrics.

    Raises:
        NotFound: the stage has not finished, or the text encoder's weights are not on this machine.
        InvalidInput: the part is of another configuration.
    """
    gathered = gather(prepared, run, RECIPE, config)
    networks = TMR(config)
    networks.load_state_dict(_as_stored(gathered.parts["tmr"].state))
    reference = reference_of(
        PreparedData.open(prepared, verify=False), networks.motion, config
    )  # `gather` has verified
    text = spec_of(open_encoder(gathered.text))
    motion = networks.motion
    return write_bundle(
        bundle,
        config,
        {"motion": motion.state_dict(), "text": networks.text.state_dict()},
        (motion.mean.numpy(), motion.std.numpy()),
        reference,
        text=text,
        card=card or card_of(bundle.name, config, text, gathered.manifest, reference),
        overwrite=overwrite,
        **gathered.manifest,
    )


def renew_reference(bundle: Bundle, prepared: Path, output: Path, *, overwrite: bool = False) -> Bundle:
    """Write a bundle's networks again with a reference from these data: your own test clips, or new measurements. The
    result is another exact bundle, and its numbers compare with its own alone.

    The card is generated again; metrics stay those of the training.

    Raises:
        InvalidBundle: another kind of evaluator, or damaged.
        InvalidInput: data of another layout.
        NotFound, InvalidFile: the data do not exist or are damaged.
    """
    config, motion, text = load_networks(bundle)
    data = PreparedData.open(prepared)
    if (data.manifest.layout, data.manifest.fps) != (config.layout, config.fps):
        raise InvalidInput(f"holds {data.manifest.layout}, this evaluator reads {config.layout}", where=str(prepared))
    known = bundle.manifest
    assert known.text is not None  # `write_bundle` sets it
    reference = reference_of(data, motion, config)
    manifest = {"licence": known.licence, "data": known.data, "metrics": known.metrics, "training": known.training}
    return write_bundle(
        output,
        config,
        {"motion": motion.state_dict(), "text": text.state_dict()},
        bundle.statistics(),
        reference,
        text=known.text,
        card=card_of(output.name, config, known.text, manifest, reference),
        model=known.model,
        dtype=_stored_dtype(bundle),
        overwrite=overwrite,
        **manifest,
    )


def _stored_dtype(bundle: Bundle) -> type[np.floating]:
    """Return the precision of a bundle's tensors: half for trained ones, single for imported ones."""
    floating = {value.dtype for value in bundle.tensors("motion", dtype=None).values() if value.dtype.kind == "f"}
    return np.float16 if floating == {np.dtype(np.float16)} else np.float32


def _as_stored(state: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """Round weights as a bundle rounds them: the reference is embedded by the weights that will be loaded."""
    return {
        name: value if name in ("motion.mean", "motion.std") else value.half().float() for name, value in state.items()
    }


def reference_of(data: PreparedData, motion: MotionEncoder, config: EvaluatorConfig) -> RealClips:
    """Compute the reference that a bundle with these networks stores for the captioned clips of prepared data.

    Joints are decoded from the features, as those of generated motions are.
    """
    motion.eval().requires_grad_(False)
    splits: dict[str, ReferenceSplit] = {}
    for name in SPLITS:
        clips = [c for c in data.split(name) if c.captions and c.length >= config.min_frames]
        if clips:
            features = [np.array(data.features(c)[: config.max_frames]) for c in clips]
            joints = (data.layout.decode(each) for each in features)
            rows = [
                ReferenceClip.of(clip, each, config.fps, config.max_frames)
                for clip, each in zip(clips, joints, strict=True)
            ]
            splits[name] = ReferenceSplit.of(rows, embed_motions(motion, features))
    return RealClips(splits)
