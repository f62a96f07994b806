"""Assembly of a bundle from the parts of a run, and its inverse: the parts of a bundle as a run to continue from."""

from __future__ import annotations

from pathlib import Path

from marey.bundles import Bundle
from marey.models.momaskpp.bundle import MODEL, load_networks
from marey.models.momaskpp.config import MoMaskPPConfig
from marey.training.assembly import gather, scatter
from marey.training.staging import TrainingRecipe

BUILT_FROM = {
    "tokenizer": ("layout", "features", "joints", "max_frames", "tokenizer"),
    "masked": ("tokenizer", "text", "max_frames", "masked"),
    "refiner": ("layout", "features", "refiner"),
    "length": ("text", "max_frames", "length_hidden"),
}
NAMES = {
    "encoder.in_proj": "encoder.enter",
    "encoder.out_proj": "encoder.leave",
    "decoder.in_proj": "decoder.enter",
    "decoder.out_proj": "decoder.leave",
}
"""Convolutions that published checkpoints call so, and what other models here call the same ones."""
SHARES = {"tokenizer": 0.42, "masked": 0.52, "refiner": 0.04, "length": 0.02}
"""Shares of the stages in the minutes of a whole training; those of stages that a configuration lacks are dealt out."""


def recipe_of(config: MoMaskPPConfig) -> TrainingRecipe[MoMaskPPConfig]:
    """Return the stages of a configuration: the refiner and the length estimator are optional."""
    lacking = {"refiner": not config.has_refiner, "length": not config.has_length}
    built_from = {name: fields for name, fields in BUILT_FROM.items() if not lacking.get(name)}
    total = sum(SHARES[name] for name in built_from)
    shares = {name: SHARES[name] / total for name in built_from}
    return TrainingRecipe(MoMaskPPConfig.from_dict, built_from, shares, most_steps={"length": 1000}, names=NAMES)


def assemble(
    prepared: Path,
    run: Path,
    bundle: Path,
    config: MoMaskPPConfig,
    *,
    card: str | None = None,
    overwrite: bool = False,
) -> Bundle:
    """Write the bundle from the parts of a run.

    Raises:
        NotFound: a stage has not finished.
        InvalidInput: parts of different configurations.
    """
    gathered = gather(prepared, run, recipe_of(config), config)
    return gathered.write(bundle, MODEL, config, card=card, overwrite=overwrite)


def unpack(bundle: Bundle, run: Path) -> MoMaskPPConfig:
    """Write the parts of a bundle into a run folder, as if its stages had just finished there.

    Returns:
        the bundle's configuration.

    Raises:
        InvalidInput: the run has parts already.
        InvalidBundle: of another model, or damaged.
    """
    config, networks = load_networks(bundle)
    scatter(bundle, run, recipe_of(config), networks.states(), config)
    return config
