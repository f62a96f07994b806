"""Steps recorded as CUDA graphs give what steps do that are launched one by one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import pytest
import torch
import torch.nn.functional as F
from torch import Tensor, nn

from marey.training.budget import Budget
from marey.training.cuda_graphs import tensors_of
from marey.training.loop import RunOptions, train
from marey.training.optimisation import StageConfig
from marey.training.stages import RecordableStage, StepContext


@dataclass(frozen=True)
class Pair:
    inputs: tuple[Tensor, Tensor]
    sizes: Tensor


@dataclass
class Halves:
    """Learns to halve numbers, in batches of two sizes."""

    device: str
    name = "halves"
    optimisation = StageConfig(batch=8, learning_rate=1e-2, ema=0.9)
    recordable: bool = True
    stops: int | None = None  # the step at which it is interrupted
    eager: int = 0
    batches: list[int] = field(default_factory=list)

    def __post_init__(self) -> None:
        torch.manual_seed(0)
        self.module: nn.Module = nn.Sequential(nn.Linear(4, 16), nn.GELU(), nn.Linear(16, 4)).to(self.device)

    def clip_groups(self) -> Sequence[Sequence[nn.Parameter]]:
        return [list(self.module.parameters())]

    def batch(self, context: StepContext) -> tuple[Tensor, Tensor]:
        rows = int(context.rng.choice([8, 16]))
        x = torch.from_numpy(context.rng.standard_normal((rows, 4))).float().to(self.device)
        return x, torch.full((1,), context.fraction, device=self.device)

    def batch_loss(self, batch: tuple[Tensor, Tensor]) -> tuple[Tensor, Mapping[str, Tensor]]:
        x, fraction = batch
        self.batches.append(len(x))
        loss = (1 + fraction[0]) * F.mse_loss(self.module(x), x / 2)
        return loss, {"loss": loss.detach()}

    def loss(self, context: StepContext) -> tuple[Tensor, Mapping[str, Tensor]]:
        self.eager += 1
        return self.batch_loss(self.batch(context))

    def after_step(self, context: StepContext) -> None:
        if context.step == self.stops:
            raise KeyboardInterrupt

    def validate(self) -> Mapping[str, float]:
        return {}


def test_tensors_of_nested_batches_come_in_their_order() -> None:
    a, b, c = torch.zeros(1), torch.ones(2), torch.ones(3)
    assert [each.shape[0] for each in tensors_of((Pair((a, b), c), a))] == [1, 2, 3, 1]


def test_on_a_processor_steps_are_launched_one_by_one(tmp_path: Path) -> None:
    stage = Halves("cpu")
    train(stage, RunOptions(tmp_path, Budget(steps=5), quiet=True), {})
    assert stage.eager == 5


@pytest.mark.gpu
def test_recorded_steps_train_as_others_do(tmp_path: Path) -> None:
    trained: dict[bool, Halves] = {}
    for record in (True, False):
        stage = trained[record] = Halves("cuda")
        assert isinstance(stage, RecordableStage)
        options = RunOptions(tmp_path / str(record), Budget(steps=60), quiet=True, record=record, bf16=False)
        train(stage, options, {})
    assert trained[True].eager == 0
    assert sorted(set(trained[True].batches)) == [8, 16]
    assert len(trained[True].batches) <= 2 * 4  # three steps of each size, and its record
    for ours, theirs in zip(trained[True].module.parameters(), trained[False].module.parameters(), strict=True):
        torch.testing.assert_close(ours, theirs, rtol=1e-4, atol=1e-5)


@pytest.mark.gpu
def test_a_recorded_run_resumes_where_it_stopped(tmp_path: Path) -> None:
    whole, broken, resumed = Halves("cuda"), Halves("cuda", stops=20), Halves("cuda")
    options = RunOptions(tmp_path / "whole", Budget(steps=40), quiet=True, bf16=False, checkpoint_minutes=0)
    train(whole, options, {})
    with pytest.raises(KeyboardInterrupt):
        train(broken, replace(options, folder=tmp_path / "run"), {})
    train(resumed, replace(options, folder=tmp_path / "run", resume=True), {})
    for ours, theirs in zip(resumed.module.parameters(), whole.module.parameters(), strict=True):
        torch.testing.assert_close(ours, theirs, rtol=1e-4, atol=1e-5)
