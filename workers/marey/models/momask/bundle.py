"""MoMask's networks as one bundle: writing, loading, and a random bundle for tests."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from marey.bundles import Bundle, TextSpec
from marey.models.momask.config import MoMaskConfig, named_config
from marey.models.momask.model import LengthEstimator, MaskedTransformer, ResidualTransformer
from marey.models.momask.tokenizer import Tokenizer
from marey.nn.bundling import NetworkParts, load_parts, write_random
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


def load_networks(bundle: Bundle) -> tuple[MoMaskConfig, Networks]:
    """Build and fill the networks of a bundle; see `load_parts`."""
    return load_parts(bundle, MODEL, MoMaskConfig.from_dict, Networks.build)


def random_bundle(path: Path | str, config: str | MoMaskConfig = "tiny", seed: int = 0) -> Bundle:
    """Write a bundle with random weights, for tests; see `write_random`."""
    config = named_config(config) if isinstance(config, str) else config
    encoder = "minilm" if config.text_width == 384 else "clip-vit-b32"
    text = TextSpec(encoder=encoder, width=config.text_width, labeller=NO_LABELLER)
    return write_random(path, MODEL, config, Networks.build, ("masked", "residual"), seed, text=text, dtype=np.float32)
