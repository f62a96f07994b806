"""From the trained part of a run to a bundle."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from torch import Tensor

from shared.bundles import Bundle
from workers.evaluator.bundle import write_bundle
from workers.evaluator.card import card_of
from workers.evaluator.config import EvaluatorConfig
from workers.evaluator.model import TMR, MotionEncoder
from workers.evaluator.reference import SPLITS, Reference, ReferenceClip, ReferenceSplit
from workers.evaluator.sentences import open_encoder, spec_of
from workers.evaluator.tmr import embed_motions
from workers.training.assembly import gather
from workers.training.data.prepared import PreparedData
from workers.training.staging import Recipe

RECIPE = Recipe(
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

    Without `card` one is written from the metrics.

    Raises:
        NotFound: the stage has not finished, or the text encoder's weights are not on this machine.
        InvalidInput: the part is of another configuration.
    """
    gathered = gather(prepared, run, RECIPE, config)
    networks = TMR(config)
    networks.load_state_dict(_as_stored(gathered.parts["tmr"].state))
    reference = _reference(PreparedData.open(prepared, verify=False), networks.motion, config)  # `gather` has verified
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


def _as_stored(state: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """Weights rounded as a bundle rounds them: the reference is embedded by what will be loaded."""
    return {
        name: value if name in ("motion.mean", "motion.std") else value.half().float() for name, value in state.items()
    }


def _reference(data: PreparedData, motion: MotionEncoder, config: EvaluatorConfig) -> Reference:
    motion.eval().requires_grad_(False)
    splits: dict[str, ReferenceSplit] = {}
    for name in SPLITS:
        clips = [c for c in data.split(name) if c.captions and c.length >= config.min_frames]
        if clips:
            features = [np.array(data.features(c)[: config.max_frames]) for c in clips]
            rows = tuple(ReferenceClip.of(c, config.max_frames) for c in clips)
            splits[name] = ReferenceSplit(rows, embed_motions(motion, features))
    return Reference(splits)
