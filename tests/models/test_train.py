"""Every stage of every model's training joins the processes that torchrun started, before it reads anything."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch.distributed as dist

from marey.registry import get_model, model_names, resolve
from marey.training.budget import Budget
from marey.training.staging import TrainOptions

STAGES = [
    (name, stage.name)
    for name in model_names()
    if (training := get_model(name).training) is not None
    for stage in training.stages
]


class JoinedError(Exception):
    """The process group would begin here: it waits for the other process."""


@pytest.mark.parametrize(("model", "stage"), STAGES)
def test_a_stage_joins_the_other_processes_first(
    model: str, stage: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    training = get_model(model).training
    assert training is not None

    def join(backend: str) -> None:
        raise JoinedError(backend)

    monkeypatch.setenv("WORLD_SIZE", "2")
    monkeypatch.setattr(dist, "init_process_group", join)
    config, budget = resolve(training.config)("tiny"), Budget(steps=1, minutes=1)
    options = TrainOptions(tmp_path / "none", tmp_path / "run", config, budget, device="cpu", quiet=True)
    with pytest.raises(JoinedError):
        resolve(training.train)(stage, options)
