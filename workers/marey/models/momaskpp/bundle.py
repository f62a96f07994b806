"""MoMask++'s networks as one bundle: loading, and a random bundle for tests."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import torch

from marey.bundles import Bundle, TextSpec
from marey.models.momaskpp.config import MoMaskPPConfig, named_config
from marey.models.momaskpp.model import LengthHead, RootRefiner, ScaleTransformer
from marey.models.momaskpp.tokenizer import Tokenizer
from marey.nn.bundling import NetworkParts, parameters_of, random_parts, standing, write_generator
from marey.nn.motion_tokenizer import biased_std

MODEL = "momaskpp"


@dataclass(frozen=True)
class ScaleNetworks(NetworkParts):
    """All networks of a bundle."""

    tokenizer: Tokenizer
    masked: ScaleTransformer
    refiner: RootRefiner | None
    length: LengthHead | None

    @classmethod
    def build(cls, config: MoMaskPPConfig) -> ScaleNetworks:
        """Build freshly initialised networks: those that the configuration has."""
        return cls(
            Tokenizer(config),
            ScaleTransformer(config),
            RootRefiner(config) if config.has_refiner else None,
            LengthHead(config) if config.has_length else None,
        )


def load_networks(bundle: Bundle) -> tuple[MoMaskPPConfig, ScaleNetworks]:
    """Build and fill the networks of a bundle, float32, in evaluation mode.

    Raises:
        InvalidBundle: of another model, or its tensors do not fit its configuration.
    """
    config = MoMaskPPConfig.from_dict(parameters_of(bundle, MODEL))
    networks = ScaleNetworks.build(config)
    networks.fill(bundle)
    return config, networks


def random_bundle(path: Path | str, config: str | MoMaskPPConfig = "tiny", seed: int = 0) -> Bundle:
    """Write a bundle with random weights, for tests: it runs like a trained one (manifest `random` = true).

    Statistics are those of a person standing still, so that joints stay within a sane range.
    """
    path = Path(path)
    config = named_config(config) if isinstance(config, str) else config
    parts = random_parts(lambda: ScaleNetworks.build(config).parts(), ("masked",), seed)
    mean, std = standing(config.layout)
    text = TextSpec(encoder="minilm" if config.text.width == 384 else "t5-v1_1-base", width=config.text.width)
    biased = biased_std(torch.from_numpy(std), config.tokenizer.feature_bias).numpy()
    return write_generator(
        path, MODEL, config, parts, (mean, biased), text=text, random=True, licence="MIT", overwrite=True
    )
