"""A checkpoint is there whenever a run is killed."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch
from torch import nn

from marey.core.errors import NotFound
from marey.nn.ema import WeightAverage
from marey.training.checkpoint import TrainingState, load_checkpoint, read_state, restore_previous, save_checkpoint


def save(folder: Path, step: int) -> nn.Linear:
    network = nn.Linear(2, 2)
    optimizer = torch.optim.AdamW(network.parameters())
    network(torch.ones(1, 2)).sum().backward()
    optimizer.step()
    state = TrainingState("tokenizer", step, 1.5, 0, {}, {})
    save_checkpoint(folder, state, network, WeightAverage(network, 0.9), optimizer)
    return network


def test_a_run_that_is_killed_between_two_checkpoints_goes_on_from_the_first(tmp_path: Path) -> None:
    folder = tmp_path / "checkpoint"
    network = save(folder, 3)
    folder.rename(tmp_path / ".checkpoint.old")  # the next one is not in its place yet
    with pytest.raises(NotFound, match="no checkpoint"):
        read_state(folder)
    restore_previous(folder)
    other = nn.Linear(2, 2)
    state = load_checkpoint(folder, other, WeightAverage(other, 0.9), torch.optim.AdamW(other.parameters()))
    assert state.step == 3
    assert torch.equal(other.weight, network.weight)


def test_a_finished_checkpoint_stays(tmp_path: Path) -> None:
    folder = tmp_path / "checkpoint"
    save(folder, 3)
    folder.rename(tmp_path / ".checkpoint.old")
    save(folder, 4)
    restore_previous(folder)
    assert read_state(folder).step == 4


def test_nothing_is_brought_back_where_nothing_was_saved(tmp_path: Path) -> None:
    restore_previous(tmp_path / "checkpoint")
    with pytest.raises(NotFound, match="no checkpoint"):
        read_state(tmp_path / "checkpoint")
