"""Stages, and bundles of what they made: what `marey train` does."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

from marey.core.extras import needs_extra


def train_stage(
    model: Literal["hgm3", "mogo", "evaluator"],
    name: str,
    data: Path,
    run: Path,
    *,
    config: str,
    steps: int | None,
    minutes: float | None,
    rate: float | None = None,
    mask: Literal["hard", "random"] | None = None,
    **options: Any,
) -> dict[str, float]:
    """Train one stage of a model; its metrics. See `marey.training.staging.TrainOptions` for the options."""
    try:
        from marey.evaluator import config as evaluator_config
        from marey.evaluator import train as evaluator
        from marey.models.hgm3 import config as hgm3_config
        from marey.models.hgm3 import train as hgm3
        from marey.models.mogo import config as mogo_config
        from marey.models.mogo import train as mogo
        from marey.training.budget import Budget
        from marey.training.optimisation import with_learning_rate
        from marey.training.staging import TrainOptions
    except ImportError as error:
        raise needs_extra("train", error) from error
    budget = Budget(steps, minutes)
    if model == "hgm3":
        chosen = with_learning_rate(hgm3_config.named_config(config, mask=mask), name, rate)
        return hgm3.train_stage(name, TrainOptions(data, run, chosen, budget, **options))
    if model == "evaluator":
        judge = with_learning_rate(evaluator_config.named_config(config), name, rate)
        return evaluator.train_stage(name, TrainOptions(data, run, judge, budget, **options))
    mogos = with_learning_rate(mogo_config.named_config(config), name, rate)
    return mogo.train_stage(name, TrainOptions(data, run, mogos, budget, **options))


def assemble_bundle(
    model: Literal["hgm3", "mogo", "evaluator"],
    data: Path,
    run: Path,
    output: Path,
    *,
    config: str,
    card: Path | None,
    overwrite: bool,
    mask: Literal["hard", "random"] | None = None,
) -> str:
    """Write the bundle of a run; its exact reference."""
    try:
        from marey.evaluator import assembly as evaluator
        from marey.evaluator import config as evaluator_config
        from marey.models.hgm3 import assembly as hgm3
        from marey.models.hgm3 import config as hgm3_config
        from marey.models.mogo import assembly as mogo
        from marey.models.mogo import config as mogo_config
    except ImportError as error:
        raise needs_extra("train", error) from error
    text = None if card is None else card.read_text(encoding="utf-8")
    if model == "hgm3":
        chosen = hgm3_config.named_config(config, mask=mask)
        return hgm3.assemble(data, run, output, chosen, card=text, overwrite=overwrite).reference
    if model == "evaluator":
        judge = evaluator_config.named_config(config)
        return evaluator.assemble(data, run, output, judge, card=text, overwrite=overwrite).reference
    return mogo.assemble(data, run, output, mogo_config.named_config(config), card=text, overwrite=overwrite).reference


def take_bundle_apart(model: Literal["hgm3", "mogo"], bundle: str, run: Path) -> str:
    """Write the parts of a bundle into a run folder; the name of its configuration."""
    try:
        from marey.bundles import find_bundle
        from marey.models.hgm3 import assembly as hgm3
        from marey.models.mogo import assembly as mogo
    except ImportError as error:
        raise needs_extra("train", error) from error
    take_apart = hgm3.take_apart if model == "hgm3" else mogo.take_apart
    return take_apart(find_bundle(bundle), run).name


def renew_reference(bundle: str, data: Path, output: Path, *, overwrite: bool) -> str:
    """Write an evaluator's networks with a reference of these data; the new bundle's exact reference."""
    try:
        from marey.bundles import find_bundle
        from marey.evaluator.assembly import renew_reference
    except ImportError as error:
        raise needs_extra("train", error) from error
    return renew_reference(find_bundle(bundle), data, output, overwrite=overwrite).reference
