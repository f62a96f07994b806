"""Assembly of a bundle from the parts of a run, and its inverse."""

from __future__ import annotations

from pathlib import Path

from marey.bundles import Bundle
from marey.models.mogo.bundle import MODEL, load_networks
from marey.models.mogo.config import MOGOConfig
from marey.nn.bundling import write_generator
from marey.training.assembly import gather, scatter
from marey.training.staging import TrainingRecipe

RECIPE = TrainingRecipe(
    read=MOGOConfig.from_dict,
    built_from={
        "tokenizer": ("layout", "features", "joints", "tokenizer"),
        "transformer": ("tokenizer", "condition", "max_frames", "transformer", "depth", "ahead"),
    },
    shares={"tokenizer": 0.4, "transformer": 0.6},
)


def assemble(
    prepared: Path, run: Path, bundle: Path, config: MOGOConfig, *, card: str | None = None, overwrite: bool = False
) -> Bundle:
    """Write the bundle from the parts of a run.

    Raises:
        NotFound: a stage has not finished.
        InvalidInput: parts of different configurations.
    """
    gathered = gather(prepared, run, RECIPE, config)
    states = {name: dict(part.state) for name, part in gathered.parts.items()}
    statistics = (states["tokenizer"].pop("mean").numpy(), states["tokenizer"].pop("std").numpy())
    text = gathered.text.model_copy(update={"split_actions": config.split_actions})
    return write_generator(
        bundle, MODEL, config, states, statistics,
        text=text, card=card, overwrite=overwrite, **gathered.manifest,
    )  # fmt: skip


def unpack(bundle: Bundle, run: Path) -> MOGOConfig:
    """Write the parts of a bundle into a run folder, as if its stages had just finished there.

    Returns:
        the bundle's configuration.

    Raises:
        InvalidInput: the run has parts already.
        InvalidBundle: of another model, or damaged.
    """
    config, tokenizer, transformer = load_networks(bundle)
    states = {"tokenizer": tokenizer.state_dict(), "transformer": transformer.state_dict()}
    scatter(bundle, run, RECIPE, states, config)
    return config
