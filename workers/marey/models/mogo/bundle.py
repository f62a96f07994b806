"""MOGO's networks as one bundle: assembly, loading, and a random bundle for tests."""

from __future__ import annotations

from pathlib import Path

import torch

from marey.bundles import Bundle, TextSpec
from marey.core.errors import InvalidBundle
from marey.models.mogo.config import MOGOConfig, named_config
from marey.models.mogo.model import RQHCTransformer
from marey.models.mogo.tokenizer import Tokenizer
from marey.nn.bundling import fill, random_parts, standing, write_generator

MODEL = "mogo"


def load_networks(bundle: Bundle) -> tuple[MOGOConfig, Tokenizer, RQHCTransformer]:
    """Build and fill the networks of a bundle, float32, in evaluation mode.

    Raises:
        InvalidBundle: of another model, or its tensors do not fit its configuration.
    """
    if bundle.manifest.model != MODEL:
        raise InvalidBundle(f"a bundle of model {bundle.manifest.model}, not {MODEL}", where=str(bundle.path))
    config = MOGOConfig.from_dict(bundle.manifest.parameters)
    tokenizer, transformer = Tokenizer(config), RQHCTransformer(config)
    fill(tokenizer, bundle, "tokenizer")
    fill(transformer, bundle, "transformer")
    mean, std = (torch.from_numpy(v) for v in bundle.statistics())
    tokenizer.set_statistics(mean, std)
    return config, tokenizer, transformer


def random_bundle(path: Path | str, config: str | MOGOConfig = "tiny", seed: int = 0) -> Bundle:
    """Write a bundle with random weights, for tests: it runs like a trained one (manifest `random` = true).

    Statistics are those of a person standing still, so that joints stay within a sane range.
    """
    path = Path(path)
    config = named_config(config) if isinstance(config, str) else config
    parts = random_parts(
        lambda: {"tokenizer": Tokenizer(config), "transformer": RQHCTransformer(config)}, ("transformer",), seed
    )
    width = config.condition.text_width
    text = TextSpec(
        encoder="minilm" if width == 384 else "clip-vit-l14", width=width, split_actions=config.split_actions
    )
    return write_generator(
        path, MODEL, config, parts, standing(config.layout), text=text, random=True, licence="MIT", overwrite=True
    )
