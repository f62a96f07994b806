"""Stages, and bundles of what they made: what `marey train` does."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from marey.core.extras import needs_extra
from marey.registry import Training, find_model, model_names, resolve


def trained_models() -> dict[str, Training]:
    """The models that can be trained here, by name."""
    specs = (find_model(name) for name in model_names())
    return {spec.name: spec.training for spec in specs if spec is not None and spec.training is not None}


def train_stage(
    training: Training,
    name: str,
    data: Path,
    run: Path,
    *,
    config: str,
    steps: int | None,
    minutes: float | None,
    rate: float | None = None,
    choices: Mapping[str, str] | None = None,
    **options: Any,
) -> dict[str, float]:
    """Train one stage; its metrics.

    Args:
        choices: of the model's own options.
        options: of `marey.training.staging.TrainOptions`.
    """
    try:
        from marey.training.budget import Budget
        from marey.training.optimisation import with_learning_rate
        from marey.training.staging import TrainOptions

        named_config, train = resolve(training.config), resolve(training.train)
    except ImportError as error:
        raise needs_extra("train", error) from error
    chosen = with_learning_rate(named_config(config, **(choices or {})), name, rate)
    return train(name, TrainOptions(data, run, chosen, Budget(steps, minutes), **options))


def assemble_bundle(
    training: Training,
    data: Path,
    run: Path,
    output: Path,
    *,
    config: str,
    card: Path | None,
    overwrite: bool,
    choices: Mapping[str, str] | None = None,
) -> str:
    """Write the bundle of a run; its exact reference."""
    try:
        named_config, assemble = resolve(training.config), resolve(training.assemble)
    except ImportError as error:
        raise needs_extra("train", error) from error
    text = None if card is None else card.read_text(encoding="utf-8")
    chosen = named_config(config, **(choices or {}))
    return assemble(data, run, output, chosen, card=text, overwrite=overwrite).reference


def unpack_bundle(training: Training, bundle: str, run: Path) -> str:
    """Write the parts of a bundle into a run folder; the name of its configuration."""
    assert training.unpack is not None  # else there is no such command
    try:
        from marey.bundles import find_bundle

        unpack = resolve(training.unpack)
    except ImportError as error:
        raise needs_extra("train", error) from error
    return unpack(find_bundle(bundle), run).name


def renew_reference(bundle: str, data: Path, output: Path, *, overwrite: bool) -> str:
    """Write an evaluator's networks with a reference of these data; the new bundle's exact reference."""
    try:
        from marey.bundles import find_bundle
        from marey.evaluator.assembly import renew_reference
    except ImportError as error:
        raise needs_extra("train", error) from error
    return renew_reference(find_bundle(bundle), data, output, overwrite=overwrite).reference
