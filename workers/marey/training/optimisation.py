"""Optimisation settings of a training stage."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Literal, TypeVar

from marey.core.configs import ADDED, Count, ModelConfig, Momentum, Part, Positive, Share, Weight, Whole
from marey.core.errors import InvalidInput

C = TypeVar("C", bound=ModelConfig)


@dataclass(frozen=True)
class StageConfig:
    """Optimisation of one training stage."""

    batch: Count  # samples a step
    learning_rate: Part = 2e-4  # of AdamW
    warmup_steps: Count = 2000  # of a linear warm-up
    warmup_share: Part = 0.05  # of the budget; the warm-up is the smaller of the two
    decay: Literal["constant", "cosine"] = "constant"  # of the learning rate behind the warm-up
    final: Share = 0.02  # end of the cosine, as a share of the learning rate
    weight_decay: Weight = 1e-5  # of matrices; biases and norms have none
    betas: tuple[Momentum, Momentum] = (0.9, 0.99)  # of AdamW
    clip: Positive = 1.0  # largest norm of the gradient
    ema: Momentum = 0.999  # of the weights that are validated and shipped; 0 = the last weights
    epochs: Whole = field(default=0, metadata=ADDED)  # budget where neither steps nor minutes are given


def with_learning_rate(config: C, stage: str, rate: float | None) -> C:
    """Return a model's configuration with another learning rate for one stage; None leaves it unchanged.

    Raises:
        InvalidInput: the stage has none, or the rate is out of range.
    """
    if rate is None:
        return config
    name = f"train_{stage}"
    if not hasattr(config, name):
        raise InvalidInput("needs a single stage", where="--learning-rate")
    if not 0 < rate <= 1:
        raise InvalidInput(f"{rate:g} is not in (0, 1]", where="--learning-rate")
    return replace(config, **{name: replace(getattr(config, name), learning_rate=rate)})


def with_batch(config: C, stages: Sequence[str], batch: int | None) -> C:
    """Return a model's configuration with another number of samples a step for these stages; None leaves it
    unchanged."""
    if batch is None:
        return config
    names = [f"train_{stage}" for stage in stages]
    return replace(config, **{name: replace(getattr(config, name), batch=batch) for name in names})
