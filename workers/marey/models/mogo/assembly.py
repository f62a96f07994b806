"""Assembly of a bundle from the parts of a run, and its inverse."""

from __future__ import annotations

from pathlib import Path

from marey.bundles import Bundle
from marey.models.mogo.bundle import MODEL, load_networks
from marey.models.mogo.config import MOGOConfig
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
    text = gathered.text.model_copy(update={"split_actions": config.split_actions})
    return gathered.write(bundle, MODEL, config, text=text, card=card, overwrite=overwrite)


def unpack(bundle: Bundle, run: Path) -> MOGOConfig:
    """Write the parts of a bundle into a run folder, as if its stages had just finished there.

    Returns:
        the bundle's configuration.

    Raises:
        InvalidInput: the run has parts already.
        InvalidBundle: of another model, or damaged.
    """
    config, networks = load_networks(bundle)
    scatter(bundle, run, RECIPE, networks.states(), config)
    return config
