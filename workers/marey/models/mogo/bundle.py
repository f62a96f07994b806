"""MOGO's networks as one bundle: assembly, loading, and a random bundle for tests."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from marey.bundles import Bundle, TextSpec
from marey.models.mogo.config import MOGOConfig, named_config
from marey.models.mogo.model import RQHCTransformer
from marey.models.mogo.tokenizer import Tokenizer
from marey.nn.bundling import NetworkParts, parameters_of, random_parts, standing, write_generator

MODEL = "mogo"


@dataclass(frozen=True)
class Networks(NetworkParts):
    """All networks of a bundle."""

    tokenizer: Tokenizer
    transformer: RQHCTransformer

    @classmethod
    def build(cls, config: MOGOConfig) -> Networks:
        """Build freshly initialised networks."""
        return cls(Tokenizer(config), RQHCTransformer(config))


def load_networks(bundle: Bundle) -> tuple[MOGOConfig, Networks]:
    """Build and fill the networks of a bundle, float32, in evaluation mode.

    Raises:
        InvalidBundle: of another model, or its tensors do not fit its configuration.
    """
    config = MOGOConfig.from_dict(parameters_of(bundle, MODEL))
    networks = Networks.build(config)
    networks.fill(bundle)
    return config, networks


def random_bundle(path: Path | str, config: str | MOGOConfig = "tiny", seed: int = 0) -> Bundle:
    """Write a bundle with random weights, for tests: it runs like a trained one (manifest `random` = true).

    Statistics are those of a person standing still, so that joints stay within a sane range.
    """
    path = Path(path)
    config = named_config(config) if isinstance(config, str) else config
    parts = random_parts(lambda: Networks.build(config).parts(), ("transformer",), seed)
    width = config.condition.text_width
    text = TextSpec(
        encoder="minilm" if width == 384 else "clip-vit-l14", width=width, split_actions=config.split_actions
    )
    return write_generator(
        path, MODEL, config, parts, standing(config.layout), text=text, random=True, licence="MIT", overwrite=True
    )
