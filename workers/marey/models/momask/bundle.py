"""MoMask's networks as one bundle: writing, loading, and a random bundle for tests."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

from marey.bundles import Bundle, TextSpec
from marey.models.momask.config import MoMaskConfig, named_config
from marey.models.momask.model import LengthEstimator, MaskedTransformer, ResidualTransformer
from marey.models.momask.tokenizer import Tokenizer
from marey.nn.bundling import NetworkParts, parameters_of, random_parts, standing, write_generator
from marey.text.keys import NO_LABELLER

MODEL = "momask"


@dataclass(frozen=True)
class Networks(NetworkParts):
    """All networks of a bundle."""

    tokenizer: Tokenizer
    masked: MaskedTransformer
    residual: ResidualTransformer
    length: LengthEstimator

    @classmethod
    def build(cls, config: MoMaskConfig) -> Networks:
        """Build freshly initialised networks."""
        return cls(Tokenizer(config), MaskedTransformer(config), ResidualTransformer(config), LengthEstimator(config))


def write_bundle(
    path: Path,
    config: MoMaskConfig,
    parts: Mapping[str, Mapping[str, Tensor]],
    statistics: tuple[NDArray[np.float32], NDArray[np.float32]],
    *,
    text: TextSpec,
    **manifest: Any,
) -> Bundle:
    """Write a bundle in float32, as the checkpoints are: logits stay equal to theirs.

    Args:
        path: the bundle's folder.
        config: of the networks.
        parts: state dict of each network.
        statistics: mean and std (D,) of the tokenizer.
        text: encoder of the sentence; prompts are read as one vector, without a labeller.
        manifest: as for `write_generator`.
    """
    return write_generator(path, MODEL, config, parts, statistics, text=text, dtype=np.float32, **manifest)


def load_networks(bundle: Bundle) -> tuple[MoMaskConfig, Networks]:
    """Build and fill the networks of a bundle, float32, in evaluation mode.

    Raises:
        InvalidBundle: of another model, or its tensors do not fit its configuration.
    """
    config = MoMaskConfig.from_dict(parameters_of(bundle, MODEL))
    networks = Networks.build(config)
    networks.fill(bundle)
    return config, networks


def random_bundle(path: Path | str, config: str | MoMaskConfig = "tiny", seed: int = 0) -> Bundle:
    """Write a bundle with random weights, for tests: it runs like an imported one (manifest `random` = true).

    Statistics are those of a person standing still, so that joints stay within a sane range.
    """
    config = named_config(config) if isinstance(config, str) else config
    encoder = "minilm" if config.text_width == 384 else "clip-vit-b32"
    text = TextSpec(encoder=encoder, width=config.text_width, labeller=NO_LABELLER)
    parts = random_parts(lambda: Networks.build(config).parts(), ("masked", "residual"), seed)
    return write_bundle(
        Path(path), config, parts, standing(config.layout), text=text, random=True, licence="MIT", overwrite=True
    )
