"""Optimisation settings of a training stage."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, TypeVar

from marey.core.configs import ModelConfig
from marey.core.errors import InvalidInput

C = TypeVar("C", bound=ModelConfig)


@dataclass(frozen=True)
class StageConfig:
    """Optimisation of one training stage."""

    batch: int
    learning_rate: float = 2e-4
    warmup_steps: int = 2000
    warmup_share: float = 0.05  # warm-up = the smaller of the two
    decay: Literal["constant", "cosine"] = "constant"
    final: float = 0.02  # end of the cosine, as a share of the learning rate
    weight_decay: float = 1e-5
    betas: tuple[float, float] = (0.9, 0.99)
    clip: float = 1.0
    ema: float = 0.999  # of the weights that are validated and shipped


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
