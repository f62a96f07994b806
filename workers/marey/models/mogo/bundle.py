"""MOGO's networks as one bundle: assembly, loading, and a random bundle for tests."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from marey.bundles import Bundle, TextSpec
from marey.models.mogo.config import MOGOConfig, named_config
from marey.models.mogo.level_token import build_transformer
from marey.models.mogo.model import RQHCTransformer
from marey.models.mogo.tokenizer import Tokenizer
from marey.nn.bundling import NetworkParts, load_parts, write_random

MODEL = "mogo"


@dataclass(frozen=True)
class Networks(NetworkParts):
    """All networks of a bundle."""

    tokenizer: Tokenizer
    transformer: RQHCTransformer

    @classmethod
    def build(cls, config: MOGOConfig) -> Networks:
        """Build freshly initialised networks."""
        return cls(Tokenizer(config), build_transformer(config))


def load_networks(bundle: Bundle) -> tuple[MOGOConfig, Networks]:
    """Build and fill the networks of a bundle; see `load_parts`."""
    return load_parts(bundle, MODEL, MOGOConfig.from_dict, Networks.build)


def random_bundle(path: Path | str, config: str | MOGOConfig = "tiny", seed: int = 0) -> Bundle:
    """Write a bundle with random weights, for tests; see `write_random`."""
    config = named_config(config) if isinstance(config, str) else config
    width = config.condition.text_width
    text = TextSpec(
        encoder="minilm" if width == 384 else "clip-vit-l14", width=width, split_actions=config.split_actions
    )
    return write_random(path, MODEL, config, Networks.build, ("transformer",), seed, text=text)
