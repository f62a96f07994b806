"""The TMR-style evaluator's networks as a bundle: the two encoders, never the decoder."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

from marey.bundles import Bundle, BundleWriter, TextSpec
from marey.evaluator import snapmogen_model
from marey.evaluator.config import EvaluatorConfig
from marey.evaluator.model import MotionEncoder, SentenceEncoder
from marey.evaluator.networks import KIND, open_networks
from marey.evaluator.reference import RealClips
from marey.motion.features import layout
from marey.nn.bundling import NOT_STORED

MODEL = "tmr"
PUBLISHED = "tmr-published"
"""The weights of the paper, which its authors trained."""
NETWORKS = {
    MODEL: (MotionEncoder, SentenceEncoder),
    PUBLISHED: (MotionEncoder, SentenceEncoder),
    snapmogen_model.MODEL: (snapmogen_model.SnapMoGenMotionEncoder, snapmogen_model.SnapMoGenSentenceEncoder),
}
"""The encoders of each model of evaluators that is built like TMR."""
Statistics = tuple[NDArray[np.float32], NDArray[np.float32]]


def load_networks(bundle: Bundle) -> tuple[EvaluatorConfig, MotionEncoder, SentenceEncoder]:
    """Build and fill the encoders of a bundle, float32, in evaluation mode.

    Raises:
        InvalidBundle: of another kind, model or layout, or its tensors do not fit its configuration.
    """
    model = bundle.manifest.model if bundle.manifest.model in NETWORKS else MODEL
    return open_networks(bundle, model, EvaluatorConfig.from_dict, *NETWORKS[model])


def write_bundle(
    path: Path,
    config: EvaluatorConfig,
    parts: Mapping[str, Mapping[str, Tensor]],
    statistics: Statistics,
    reference: RealClips | None,
    *,
    text: TextSpec,
    card: str,
    model: str = MODEL,
    dtype: type[np.floating] = np.float16,
    overwrite: bool = False,
    **manifest: Any,
) -> Bundle:
    """Write a bundle.

    Args:
        path: the bundle's folder; its last name is the bundle's.
        config: configuration of the networks.
        parts: state dicts of `motion` and `text`.
        statistics: mean and std (D,) that normalise motions.
        reference: captions and embeddings of real clips; None = written later (`renew_reference`).
        text: the encoder, with its hash.
        card: the model card.
        model: one of `NETWORKS`.
        dtype: of the stored tensors.
        overwrite: replace an existing bundle.
        manifest: licence, data, metrics, training.
    """
    with BundleWriter(path, overwrite=overwrite) as writer:
        for name, state in parts.items():
            writer.add_part(name, {k: v.cpu().numpy() for k, v in state.items() if k not in NOT_STORED}, dtype=dtype)
        writer.add_statistics(*statistics)
        if reference is not None:
            reference.add_to(writer)
        writer.add_card(card)
        return writer.finish(
            name=path.name,
            version="1",
            kind=KIND,
            model=model,
            config=config.name,
            parameters=config.to_dict(),
            skeleton=layout(config.layout).skeleton.name,
            layout=config.layout,
            fps=config.fps,
            text=text,
            **manifest,
        )
