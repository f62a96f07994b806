"""How one training stage is optimised."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class StageConfig:
    """Optimisation of one training stage."""

    batch: int
    learning_rate: float = 2e-4
    warmup_steps: int = 2000
    warmup_share: float = 0.05  # warm-up = the smaller of the two
    decay: Literal["constant", "cosine"] = "constant"
    final: float = 0.02  # where the cosine ends, as a share of the learning rate
    weight_decay: float = 1e-5
    betas: tuple[float, float] = (0.9, 0.99)
    clip: float = 1.0
    ema: float = 0.999  # of the weights that are validated and shipped
