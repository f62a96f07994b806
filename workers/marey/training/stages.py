"""Protocols of the stages that the training loop runs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np
from torch import Tensor, nn

from marey.training.optimisation import StageConfig


@dataclass(frozen=True)
class StepContext:
    """Inputs that a stage may use in one step."""

    step: int
    fraction: float  # of the budget, 0 to 1: every schedule runs on it
    rng: np.random.Generator  # for the choice of data, seeded from (seed, step, rank)


class TrainingStage(Protocol):
    """One stage of training."""

    @property
    def name(self) -> str:
        """Name of the stage, `tokenizer` for instance."""
        ...

    @property
    def module(self) -> nn.Module:
        """Module with all trained parameters and all tensors of a checkpoint."""
        ...

    @property
    def optimisation(self) -> StageConfig:
        """Batch size, learning rate and other optimisation settings."""
        ...

    def clip_groups(self) -> Sequence[Sequence[nn.Parameter]]:
        """Groups of parameters whose gradient norms are clipped separately."""
        ...

    def loss(self, context: StepContext) -> tuple[Tensor, Mapping[str, Tensor]]:
        """Return the loss of one batch, and values to log."""
        ...

    def after_step(self, context: StepContext) -> None:
        """Update state after the optimiser's step (a teacher, for instance)."""
        ...

    def validate(self) -> Mapping[str, float]:
        """Return metrics of the averaged weights on the validation split."""
        ...


@runtime_checkable
class SplitStage(Protocol):
    """A stage whose batches can be trained in parts, each with its own backward pass: gradient accumulation."""

    def parts(self, context: StepContext, size: int) -> Iterator[tuple[Tensor, Mapping[str, Tensor]]]:
        """Yield the losses of parts of one batch, at most `size` samples each, and values to log; sums over the parts
        are those of the whole batch."""
        ...


@runtime_checkable
class RecordableStage(TrainingStage, Protocol):
    """A stage whose steps can be recorded."""

    @property
    def recordable(self) -> bool:
        """Return whether its configuration allows it."""
        ...

    def batch(self, context: StepContext) -> Any:
        """Draw a batch, all random choices made that depend on `context.rng`: a dataclass or tuple of tensors on the
        device, or of such, in one of a few shapes."""
        ...

    def batch_loss(self, batch: Any) -> tuple[Tensor, Mapping[str, Tensor]]:
        """Return the loss of a batch and values to log, without reading a value of a tensor on the host."""
        ...
