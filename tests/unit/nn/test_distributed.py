"""Gradients of several processes, of which one is played."""

from __future__ import annotations

import pytest
import torch
import torch.distributed as dist

from marey.nn import distributed


def test_gradients_are_averaged_parameter_by_parameter(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(distributed, "is_distributed", lambda: True)
    monkeypatch.setattr(dist, "get_world_size", lambda: 2)
    monkeypatch.setattr(dist, "all_reduce", lambda tensor: tensor.add_(tensor))  # the other process has the same
    first, second, still = (torch.nn.Parameter(torch.zeros(shape)) for shape in ((2, 2), (3,), (1,)))
    first.grad, second.grad = torch.arange(4.0).view(2, 2), torch.tensor([5.0, 6.0, 7.0])
    distributed.average_gradients([first, second, still])
    assert torch.equal(first.grad, torch.arange(4.0).view(2, 2))
    assert torch.equal(second.grad, torch.tensor([5.0, 6.0, 7.0]))
    assert still.grad is not None
    assert not still.grad.any()
