"""Checkpoints of a tiny network, whole and broken."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import torch
from torch import nn


@pytest.fixture
def network() -> nn.Module:
    torch.manual_seed(0)
    return nn.Sequential(nn.Linear(3, 4), nn.Linear(4, 2))


@pytest.fixture
def saved(network: nn.Module, tmp_path: Path) -> Path:
    """A file as other projects leave it: weights under a key, a counter, an optimizer that has made a step."""
    optimizer = torch.optim.Adam(network.parameters())
    network(torch.ones(1, 3)).sum().backward()
    optimizer.step()
    network.zero_grad()
    return save(
        tmp_path / "net_best.tar",
        {"model": {f"net.{k}": v for k, v in network.state_dict().items()}, "ep": 7, "opt_net": optimizer.state_dict()},
    )


def save(file: Path, value: Any, **options: Any) -> Path:
    file.parent.mkdir(parents=True, exist_ok=True)
    torch.save(value, file, **options)
    return file
