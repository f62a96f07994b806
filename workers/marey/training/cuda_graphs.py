"""Training steps recorded as CUDA graphs: steps of small networks are bound by the launches of their kernels.

The forward pass, the backward pass, the optimiser and the moving average of the weights of one step are recorded, and
replayed with other batches. So a stage's loss must not read values of tensors on the host, and batches must have few
different shapes: each is recorded by itself.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor, nn

from marey.nn.ema import WeightAverage, warm_momentum
from marey.training.stages import RecordableStage, StepContext

EAGER = 3
"""Steps of a shape before it is recorded: libraries choose their kernels in them."""


@dataclass(frozen=True)
class StepResult:
    """Values of a step, which the next one overwrites."""

    logs: Mapping[str, Tensor]
    norms: tuple[Tensor, ...]  # of the gradients, one a group


@dataclass(frozen=True)
class _Recording:
    graph: torch.cuda.CUDAGraph
    batch: Any  # whose tensors the graph reads
    result: StepResult


class RecordedSteps:
    """The steps of one stage, recorded by the shapes of its batches."""

    def __init__(
        self,
        stage: RecordableStage,
        optimizer: torch.optim.AdamW,
        average: WeightAverage,
        autocast: Callable[[], AbstractContextManager[Any]],
    ) -> None:
        """Record steps of `optimizer`, which must be capturable, and of `average`; losses run under `autocast`."""
        self._stage, self._optimizer, self._average, self._autocast = stage, optimizer, average, autocast
        device = next(stage.module.parameters()).device
        self._rate = torch.zeros((), device=device)
        self._weight = torch.zeros((), device=device)
        self._stream = torch.cuda.Stream(device)
        self._seen: dict[tuple[torch.Size, ...], int] = {}
        self._recordings: dict[tuple[torch.Size, ...], _Recording] = {}
        for group in optimizer.param_groups:
            group["lr"] = self._rate

    def step(self, context: StepContext, rate: float) -> StepResult:
        """Make one step with the learning rate `rate`."""
        batch = self._stage.batch(context)
        self._rate.fill_(rate)
        self._weight.fill_(1 - warm_momentum(self._average.momentum, context.step))
        tensors = tensors_of(batch)
        shapes = tuple(tensor.shape for tensor in tensors)
        self._seen[shapes] = self._seen.get(shapes, 0) + 1
        if self._seen[shapes] <= EAGER:
            return self._eager(batch)
        if shapes not in self._recordings:
            self._recordings[shapes] = self._record(batch)
        recording = self._recordings[shapes]
        for mine, theirs in zip(tensors_of(recording.batch), tensors, strict=True):
            mine.copy_(theirs)
        recording.graph.replay()
        return recording.result

    def _eager(self, batch: Any) -> StepResult:
        self._stream.wait_stream(torch.cuda.current_stream())
        with torch.cuda.stream(self._stream):
            result = self._work(batch)
        torch.cuda.current_stream().wait_stream(self._stream)
        return result

    def _record(self, batch: Any) -> _Recording:
        graph = torch.cuda.CUDAGraph()
        self._optimizer.zero_grad(set_to_none=True)
        with torch.cuda.graph(graph):
            result = self._work(batch)
        return _Recording(graph, batch, result)

    def _work(self, batch: Any) -> StepResult:
        self._optimizer.zero_grad(set_to_none=True)
        with self._autocast():
            loss, logs = self._stage.batch_loss(batch)
        loss.backward()
        clip = self._stage.optimisation.clip
        norms = tuple(nn.utils.clip_grad_norm_(group, clip) for group in self._stage.clip_groups())
        self._optimizer.step()
        self._average.blend(self._weight)
        return StepResult({name: value.detach() for name, value in logs.items()}, norms)


def tensors_of(value: Any) -> list[Tensor]:
    """Return the tensors of a dataclass or tuple, and of those inside it, in their order."""
    if isinstance(value, Tensor):
        return [value]
    parts = value if isinstance(value, tuple) else [getattr(value, field.name) for field in dataclasses.fields(value)]
    return [tensor for part in parts for tensor in tensors_of(part)]
