"""Training of a tiny model by two processes, which torchrun starts on a CPU (gloo): by functions, and by the command.

torchrun --nproc-per-node=2 -m tests.support.two_processes FOLDER MODEL
"""

from __future__ import annotations

import faulthandler
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

import torch
import torch.distributed as dist
from safetensors.torch import load_file

from marey.nn import distributed
from marey.nn.quantizer import ResidualQuantizer
from marey.registry import Training, find_model, resolve
from marey.training import loop, staging
from marey.training.budget import Budget
from marey.training.checkpoint import TrainingState, restore_previous, save_checkpoint
from marey.training.staging import TrainOptions
from tests.support.prepared import write_prepared

ROOT = Path(__file__).parents[2]
STEPS = 4
DEADLINE = 150
"""Seconds after which a process that hangs says where, and ends."""
WHOLE = 12
"""Steps of the training whose processes are killed."""
PATIENCE = 400
"""Seconds that a command may take: on busy cores each exchange of gradients waits for both processes."""


def check_two_processes(folder: Path, model: str) -> set[str]:
    """Train every stage of a model by two processes, and its tokenizer once more from half of its steps.

    Returns:
        The stages that have finished.
    """
    write_prepared(folder / "prepared")
    command = [sys.executable, "-m", "torch.distributed.run", "--standalone", "--nproc-per-node=2", "-m",
               "tests.support.two_processes", str(folder), model]  # fmt: skip
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    with subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, env=environment, start_new_session=True
    ) as process:
        try:
            _, errors = process.communicate(timeout=DEADLINE + 20)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)  # the two processes too
            raise
    assert process.returncode == 0, errors[-3000:]
    whole, resumed = (
        load_file(folder / run / "tokenizer" / "part" / "weights.safetensors") for run in ("run", "again")
    )
    assert all((whole[name] == resumed[name]).all() for name in whole)
    return {path.parent.parent.name for path in (folder / "run").glob("*/part/part.json")}


def check_killed_and_resumed(folder: Path, model: str, stages: Sequence[str], killed: str) -> None:
    """Train stages of a model by the command, under torchrun, once whole and once with both processes killed in a stage
    and resumed: its weights are the same, bit for bit.

    Args:
        folder: for data and runs.
        model: its name.
        stages: to train before `killed`.
        killed: the stage whose processes are killed.
    """
    write_prepared(folder / "prepared")
    for stage in stages:
        run_command(folder, model, stage, "run", steps=2)
    shutil.copytree(folder / "run", folder / "again")
    run_command(folder, model, killed, "run", steps=WHOLE)
    state = folder / "again" / killed / "checkpoint" / "state.json"
    with start_command(folder, model, killed, "again", "--checkpoint-minutes", 0, steps=WHOLE) as process:
        try:
            wait_for(lambda: state.is_file() or process.poll() is not None)
        finally:
            os.killpg(process.pid, signal.SIGKILL)
    restore_previous(state.parent)
    step = json.loads(state.read_text())["step"]
    assert 0 < step < WHOLE, "killed in the middle"
    run_command(folder, model, killed, "again", "--resume", steps=WHOLE)
    whole, resumed = (load_file(folder / run / killed / "part" / "weights.safetensors") for run in ("run", "again"))
    assert all((whole[name] == resumed[name]).all() for name in whole)


def start_command(
    folder: Path, model: str, stage: str, run: str, *options: object, steps: int
) -> subprocess.Popen[str]:
    """Start `marey train` in two processes, as a group of its own."""
    command = [sys.executable, "-m", "torch.distributed.run", "--standalone", "--nproc-per-node=2", "--",
               str(Path(sys.executable).with_name("marey")), "train", model, stage, str(folder / "prepared"), "--run",
               str(folder / run), "--config", "tiny", "--steps", str(steps), "--threads", "1", "--device", "cpu",
               *map(str, options)]  # fmt: skip
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    return subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, env=environment, start_new_session=True
    )


def run_command(folder: Path, model: str, stage: str, run: str, *options: object, steps: int) -> None:
    """Run `marey train` in two processes to its end."""
    with start_command(folder, model, stage, run, *options, steps=steps) as process:
        try:
            _, errors = process.communicate(timeout=PATIENCE)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            raise
    assert process.returncode == 0, errors[-3000:]


def wait_for(happened: Callable[[], bool]) -> None:
    """Wait until something has happened."""
    until = time.monotonic() + PATIENCE
    while not happened():
        assert time.monotonic() < until, "it has not happened"
        time.sleep(0.02)


def quantize_with_an_empty_process(first: int) -> None:
    """Only process `first` has vectors; both end with the same codes."""
    torch.manual_seed(distributed.rank())
    quantizer = ResidualQuantizer(2, 4, 3, dropout=0.0, revive=2.0).train()
    for _ in range(3):
        valid = torch.full((2, 5), distributed.rank() == first)
        quantizer(torch.randn(2, 5, 3), valid)
    assert float(quantizer.codebooks.abs().sum()) > 0, "no codes"
    check_equal(quantizer.codebooks)


def check_equal(mine: torch.Tensor) -> None:
    """Both processes hold the same numbers."""
    other = mine.clone()
    dist.broadcast(other, src=0)
    assert torch.equal(mine, other), "the processes differ"


@contextmanager
def checkpoint_at(step: int, copy: Path) -> Iterator[None]:
    """Save a checkpoint after every step, and copy that of one step."""

    def saving(stage: loop.TrainingStage, options: loop.RunOptions, config: dict[str, Any]) -> dict[str, float]:
        metrics = loop.train(stage, replace(options, checkpoint_minutes=0.0), config)
        for value in stage.module.state_dict().values():
            check_equal(value)
        return metrics

    def copying(folder: Path, state: TrainingState, *rest: Any) -> None:
        save_checkpoint(folder, state, *rest)
        if state.step == step:
            shutil.copytree(folder, copy)

    with patch.object(staging, "train", saving), patch.object(loop, "save_checkpoint", copying):
        yield


def resume_exactly(training: Training, options: TrainOptions[Any]) -> None:
    """A tokenizer that is stopped at half of its steps and resumed is the one that is trained at once."""
    train_stage = resolve(training.train)
    half = options.run.parent / "half"
    with checkpoint_at(STEPS // 2, half):
        train_stage("tokenizer", options)
    again = replace(options, run=options.run.parent / "again", resume=True)
    if distributed.rank() == 0:
        shutil.copytree(half, again.run / "tokenizer" / "checkpoint")
    distributed.barrier()
    train_stage("tokenizer", again)


def main(folder: Path, model: str) -> None:
    """Run all of it in one of the processes."""
    faulthandler.dump_traceback_later(DEADLINE, exit=True)
    torch.set_num_threads(1)
    loop.start_process_group()
    for first in (0, 1):
        quantize_with_an_empty_process(first)
    spec = find_model(model)
    assert spec is not None
    assert spec.training is not None
    options = TrainOptions(
        folder / "prepared", folder / "run", resolve(spec.training.config)("tiny"), Budget(steps=STEPS),
        device="cpu", bf16=False, quiet=True,
    )  # fmt: skip
    resume_exactly(spec.training, options)
    resolve(spec.training.train)("all", replace(options, budget=Budget(steps=2, minutes=10)))
    dist.destroy_process_group()
    faulthandler.cancel_dump_traceback_later()


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2])
