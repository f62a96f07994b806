"""MoMask++'s networks as one bundle: loading, and a random bundle for tests."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from marey.bundles import Bundle, TextSpec
from marey.models.momaskpp.config import MoMaskPPConfig, named_config
from marey.models.momaskpp.model import LengthHead, RootRefiner, ScaleTransformer
from marey.models.momaskpp.tokenizer import Tokenizer
from marey.nn.bundling import NetworkParts, load_parts, write_random

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
    """Build and fill the networks of a bundle; see `load_parts`."""
    return load_parts(bundle, MODEL, MoMaskPPConfig.from_dict, ScaleNetworks.build)


def random_bundle(path: Path | str, config: str | MoMaskPPConfig = "tiny", seed: int = 0) -> Bundle:
    """Write a bundle with random weights, for tests; see `write_random`."""
    config = named_config(config) if isinstance(config, str) else config
    text = TextSpec(encoder="minilm" if config.text.width == 384 else "t5-v1_1-base", width=config.text.width)
    return write_random(
        path,
        MODEL,
        config,
        ScaleNetworks.build,
        ("masked",),
        seed,
        text=text,
        bias=config.tokenizer.feature_bias,
    )
