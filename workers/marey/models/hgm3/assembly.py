"""Assembly of a bundle from the parts of a run, and its inverse: the parts of a bundle as a run to continue from."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from torch import Tensor

from marey.bundles import Bundle
from marey.models.hgm3.bundle import MODEL, load_networks
from marey.models.hgm3.config import HGM3Config
from marey.training.assembly import gather, scatter
from marey.training.staging import TrainingRecipe

RECIPE = TrainingRecipe(
    read=HGM3Config.from_dict,
    built_from={
        "tokenizer": ("layout", "features", "joints", "tokenizer"),
        "masked": ("tokenizer", "condition", "compact", "max_frames", "masked", "predictor"),
        "residual": ("tokenizer", "condition", "compact", "max_frames", "residual"),
        "length": ("condition", "max_frames", "length_hidden"),
    },
    shares={"tokenizer": 0.42, "masked": 0.38, "residual": 0.18, "length": 0.02},
    most_steps={"length": 1000},  # beyond them validation loss rises again (3.17 → 3.52)
    grows={"masked": "masked", "residual": "residual"},
)


def assemble(
    prepared: Path, run: Path, bundle: Path, config: HGM3Config, *, card: str | None = None, overwrite: bool = False
) -> Bundle:
    """Write the bundle from the parts of a run.

    Raises:
        NotFound: a stage has not finished.
        InvalidInput: parts of different configurations.
    """
    gathered = gather(prepared, run, RECIPE, config)
    parts = gathered.parts
    masked = parts["masked"].state
    states = {
        "tokenizer": parts["tokenizer"].state,
        "masked": _under(masked, "masked."),
        "predictor": _under(masked, "teacher."),
        "residual": parts["residual"].state,
        "length": parts["length"].state,
    }
    condition = config.condition
    caps = {"max_actions": condition.max_actions, "max_specifics": condition.max_specifics}
    read = {"in_order": config.in_order, "plain_action": config.plain_action, "movements": config.movements}
    text = gathered.text.model_copy(update={**read, **caps})
    return gathered.write(bundle, MODEL, config, states=states, text=text, card=card, overwrite=overwrite)


def unpack(bundle: Bundle, run: Path) -> HGM3Config:
    """Write the parts of a bundle into a run folder, as if its stages had just finished there.

    Parts that a bundle does not hold are initialised: the predictor starts as its teacher.

    Returns:
        the bundle's configuration.

    Raises:
        InvalidInput: the run has parts already.
        InvalidBundle: of another model, or damaged.
    """
    config, networks = load_networks(bundle)
    predictor = networks.predictor.state_dict()
    states = {
        "tokenizer": networks.tokenizer.state_dict(),
        "masked": _over(networks.masked.state_dict(), "masked.")
        | _over(predictor, "predictor.")
        | _over(predictor, "teacher."),
        "residual": networks.residual.state_dict(),
        "length": networks.length.state_dict(),
    }
    scatter(bundle, run, RECIPE, states, config)
    return config


def _under(state: Mapping[str, Tensor], prefix: str) -> dict[str, Tensor]:
    return {name.removeprefix(prefix): value for name, value in state.items() if name.startswith(prefix)}


def _over(state: Mapping[str, Tensor], prefix: str) -> dict[str, Tensor]:
    return {prefix + name: value for name, value in state.items()}
