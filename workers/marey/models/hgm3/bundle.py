"""HGM³'s networks as one bundle: assembly, loading, and a random bundle for tests."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from marey.bundles import Bundle, TextSpec
from marey.models.hgm3.config import HGM3Config, named_config
from marey.models.hgm3.model import LengthEstimator, LossPredictor, MaskedTransformer, ResidualTransformer
from marey.models.hgm3.tokenizer import Tokenizer
from marey.nn.bundling import NetworkParts, load_parts, write_random

MODEL = "hgm3"
LOUD = ("masked", "predictor", "residual")
"""Parts of a random bundle whose matrices are scaled up."""


@dataclass(frozen=True)
class Networks(NetworkParts):
    """All networks of a bundle."""

    tokenizer: Tokenizer
    masked: MaskedTransformer
    predictor: LossPredictor  # the teacher (exponential moving average), for the heat map
    residual: ResidualTransformer
    length: LengthEstimator

    @classmethod
    def build(cls, config: HGM3Config) -> Networks:
        """Build freshly initialised networks."""
        return cls(
            Tokenizer(config),
            MaskedTransformer(config),
            LossPredictor(config),
            ResidualTransformer(config),
            LengthEstimator(config),
        )


def load_networks(bundle: Bundle) -> tuple[HGM3Config, Networks]:
    """Build and fill the networks of a bundle; see `load_parts`."""
    config, networks = load_parts(bundle, MODEL, HGM3Config.from_dict, Networks.build)
    networks.residual.set_codebooks(networks.tokenizer.quantizer.codebooks)
    return config, networks


def random_bundle(path: Path | str, config: str | HGM3Config = "tiny", seed: int = 0) -> Bundle:
    """Write a bundle with random weights, for tests; see `write_random`."""
    config = named_config(config) if isinstance(config, str) else config
    text = TextSpec(
        encoder="minilm" if config.condition.text_width == 384 else "clip-vit-b32",
        width=config.condition.text_width,
        max_actions=config.condition.max_actions,
        max_specifics=config.condition.max_specifics,
    )
    return write_random(
        path,
        MODEL,
        config,
        Networks.build,
        ("masked", "predictor", "residual"),
        seed,
        text=text,
        bias=config.tokenizer.feature_bias,
    )
