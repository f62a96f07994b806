"""Budgets, not epochs: every schedule runs on the fraction of the budget used."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from marey.core.errors import InvalidInput


@dataclass(frozen=True)
class Budget:
    """Training budget of a stage: optimiser steps, minutes, or whichever ends first."""

    steps: int | None = None
    minutes: float | None = None

    def __post_init__(self) -> None:
        if self.steps is None and self.minutes is None:
            raise InvalidInput(
                "training needs a budget",
                hint="Give --steps, --max-minutes or both, or to a single stage a configuration with epochs.",
            )
        if (self.steps is not None and self.steps < 1) or (self.minutes is not None and self.minutes <= 0):
            raise InvalidInput("a training budget must be positive", hint="Give --steps >= 1 or --max-minutes > 0.")

    def fraction(self, step: int, seconds: float) -> float:
        """Return the used share of the budget after `step` steps and `seconds` of training, 0 to 1."""
        by_steps = step / self.steps if self.steps else 0.0
        by_time = seconds / (60 * self.minutes) if self.minutes else 0.0
        return min(1.0, max(by_steps, by_time))

    @classmethod
    def of_epochs(cls, epochs: int, clips: int, batch: int) -> Budget:
        """Return the steps in which as many samples are drawn as there are training clips, `epochs` times."""
        return cls(steps=math.ceil(epochs * clips / batch))


def learning_rate(
    base: float,
    fraction: float,
    step: int,
    *,
    warmup_steps: int = 2000,
    warmup_share: float = 0.05,
    decay: Literal["constant", "cosine"] = "constant",
    final: float = 0.02,
) -> float:
    """Return the learning rate of step number `step` (from 0) at `fraction` of the budget.

    Linear warm-up over min(`warmup_steps`, `warmup_share` of the budget), then constant or a cosine down to
    `final` · base.
    """
    warm = min(1.0, max((step + 1) / warmup_steps, fraction / warmup_share))
    if decay == "constant":
        return base * warm
    past = max(0.0, fraction - warmup_share) / max(1 - warmup_share, 1e-9)  # a warm-up may be the whole budget
    return base * warm * (final + (1 - final) * 0.5 * (1 + math.cos(math.pi * past)))
