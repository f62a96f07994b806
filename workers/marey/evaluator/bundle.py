"""The TMR-style evaluator's networks as a bundle: the two encoders, never the decoder."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

from marey.bundles import Bundle, BundleWriter, TextSpec
from marey.evaluator.config import EvaluatorConfig
from marey.evaluator.model import MotionEncoder, SentenceEncoder
from marey.evaluator.networks import KIND, open_networks
from marey.evaluator.reference import RealClips
from marey.motion.features import layout
from marey.nn.bundling import NOT_STORED

MODEL = "tmr"
Statistics = tuple[NDArray[np.float32], NDArray[np.float32]]


def load_networks(bundle: Bundle) -> tuple[EvaluatorConfig, MotionEncoder, SentenceEncoder]:
    """Build and fill the encoders of a bundle, float32, in evaluation mode.

    Raises:
        InvalidBundle: of another kind, model or layout, or its tensors do not fit its configuration.
    """
    return open_networks(bundle, MODEL, EvaluatorConfig.from_dict, MotionEncoder, SentenceEncoder)


def write_bundle(
    path: Path,
    config: EvaluatorConfig,
    parts: Mapping[str, Mapping[str, Tensor]],
    statistics: Statistics,
    reference: RealClips,
    *,
    text: TextSpec,
    card: str,
    overwrite: bool = False,
    **manifest: Any,
) -> Bundle:
    """Write a bundle.

    Args:
        path: the bundle's folder; its last name is the bundle's.
        config: configuration of the networks.
        parts: state dicts of `motion` and `text`.
        statistics: mean and std (D,) that normalise motions.
        reference: captions and embeddings of real clips.
        text: the encoder, with its hash.
        card: the model card.
        overwrite: replace an existing bundle.
        manifest: licence, data, metrics, training.
    """
    with BundleWriter(path, overwrite=overwrite) as writer:
        for name, state in parts.items():
            writer.add_part(name, {k: v.cpu().numpy() for k, v in state.items() if k not in NOT_STORED})
        writer.add_statistics(*statistics)
        reference.add_to(writer)
        writer.add_card(card)
        return writer.finish(
            name=path.name,
            version="1",
            kind=KIND,
            model=MODEL,
            config=config.name,
            parameters=config.to_dict(),
            skeleton=layout(config.layout).skeleton.name,
            layout=config.layout,
            fps=config.fps,
            text=text,
            **manifest,
        )
