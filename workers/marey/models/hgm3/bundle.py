"""HGM³'s networks as one bundle: assembly, loading, and a random bundle for tests."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import torch

from marey.bundles import Bundle, TextSpec
from marey.models.hgm3.config import HGM3Config, named_config
from marey.models.hgm3.model import LengthEstimator, LossPredictor, MaskedTransformer, ResidualTransformer
from marey.models.hgm3.tokenizer import Tokenizer
from marey.nn.bundling import NetworkParts, parameters_of, random_parts, standing, write_generator
from marey.nn.motion_tokenizer import biased_std

MODEL = "hgm3"


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
    """Build and fill the networks of a bundle, float32, in evaluation mode.

    Raises:
        InvalidBundle: of another model, or its tensors do not fit its configuration.
    """
    config = HGM3Config.from_dict(parameters_of(bundle, MODEL))
    networks = Networks.build(config)
    networks.fill(bundle)
    networks.residual.set_codebooks(networks.tokenizer.quantizer.codebooks)
    return config, networks


def random_bundle(path: Path | str, config: str | HGM3Config = "tiny", seed: int = 0) -> Bundle:
    """Write a bundle with random weights, for tests: it runs like a trained one (manifest `random` = true).

    Statistics are those of a person standing still, so that joints stay within a sane range.
    """
    path = Path(path)
    config = named_config(config) if isinstance(config, str) else config
    parts = random_parts(lambda: Networks.build(config).parts(), ("masked", "predictor", "residual"), seed)
    mean, std = standing(config.layout)
    text = TextSpec(
        encoder="minilm" if config.condition.text_width == 384 else "clip-vit-b32",
        width=config.condition.text_width,
        max_actions=config.condition.max_actions,
        max_specifics=config.condition.max_specifics,
    )
    biased = biased_std(torch.from_numpy(std), config.tokenizer.feature_bias).numpy()
    return write_generator(
        path, MODEL, config, parts, (mean, biased), text=text, random=True, licence="MIT", overwrite=True
    )
