"""Check without a GPU that a training step can be recorded: on tensors without values, nothing can be read."""

from __future__ import annotations

import dataclasses
from contextlib import nullcontext
from typing import Any
from unittest.mock import patch

import numpy as np
import torch
from torch import Tensor
from torch.utils._python_dispatch import TorchDispatchMode
from torch.utils._pytree import tree_leaves

from marey.training.cuda_graphs import tensors_of
from marey.training.stages import RecordableStage, StepContext

META = torch.device("meta")
aten = torch.ops.aten


class _NoCopies(TorchDispatchMode):
    """Refuse what brings numbers of the host to the device, which recording does not allow: operations of the device
    that read a tensor of the host, and assignments of numbers (`x[0] = 1.0`), which `fill_` replaces."""

    def __init__(self) -> None:
        super().__init__()
        self._numbers: list[Tensor] = []

    def __torch_dispatch__(self, func: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        found = func(*args, **(kwargs or {}))
        given = [each for each in tree_leaves((args, kwargs)) if isinstance(each, Tensor)]
        on_device = any(each.device == META for each in tree_leaves((found, given)) if isinstance(each, Tensor))
        assert not on_device or all(each.device == META for each in given), f"{func} reads a tensor of the host"
        number = any(each is known for each in given for known in self._numbers)
        assert func is not aten.copy_.default or not number, "a number is assigned; use `fill_`"
        if func is aten.scalar_tensor.default or (number and func in (aten.view.default, aten.expand.default)):
            self._numbers.append(found)
        return found


def moved(value: Any, device: torch.device) -> Any:
    """Return a batch with all of its tensors on another device."""
    if isinstance(value, Tensor):
        return value.to(device)
    if isinstance(value, tuple):
        return tuple(moved(part, device) for part in value)
    fields = {field.name: moved(getattr(value, field.name), device) for field in dataclasses.fields(value)}
    return type(value)(**fields)


def assert_recordable(stage: RecordableStage, shapes: int = 1) -> None:
    """Compute loss and gradients of a batch on tensors without values; batches come in at most so many `shapes`."""
    assert isinstance(stage, RecordableStage)
    assert stage.recordable
    drawn = [stage.batch(StepContext(0, 0.5, np.random.default_rng(seed))) for seed in range(6)]
    assert len({tuple(each.shape for each in tensors_of(batch)) for batch in drawn}) <= shapes
    stage.module.to(META).train()
    batch = moved(drawn[0], META)
    # autocast does not know this device
    unknown = patch.multiple(torch, is_autocast_enabled=lambda *_: False, autocast=lambda *_, **__: nullcontext())
    with unknown, _NoCopies():
        loss, logs = stage.batch_loss(batch)
        loss.backward()
    assert loss.device == META
    assert all(value.device == META for value in logs.values())
