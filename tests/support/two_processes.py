"""Work of the two processes in `tests/models/hgm3/test_two_processes.py`, each started by torchrun.

torchrun --nproc-per-node=2 -m tests.support.two_processes FOLDER
"""

from __future__ import annotations

import shutil
import sys
from dataclasses import replace
from pathlib import Path

import torch
import torch.distributed as dist

from marey.models.hgm3.config import TINY, HGM3Config
from marey.models.hgm3.train import train_stage
from marey.nn import distributed
from marey.nn.quantizer import ResidualQuantizer
from marey.training import loop
from marey.training.budget import Budget
from marey.training.staging import TrainOptions

STEPS = 6


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


def resume_exactly(options: TrainOptions[HGM3Config]) -> None:
    """A tokenizer that is stopped at half of its steps and resumed is the one that is trained at once."""
    saved: list[Path] = []
    save = loop.save_checkpoint

    def copying(folder: Path, state, *rest) -> None:
        save(folder, state, *rest)
        if state.step == STEPS // 2:
            saved.append(shutil.copytree(folder, options.run.parent / "half"))

    loop.save_checkpoint = copying
    minutes = loop.RunOptions.checkpoint_minutes
    loop.RunOptions.checkpoint_minutes = 0.0
    try:
        train_stage("tokenizer", options)
    finally:
        loop.save_checkpoint, loop.RunOptions.checkpoint_minutes = save, minutes
    again = replace(options, run=options.run.parent / "again", resume=True)
    if distributed.rank() == 0:
        shutil.copytree(options.run.parent / "half", again.run / "tokenizer" / "checkpoint")
    distributed.barrier()
    train_stage("tokenizer", again)


def main(folder: Path) -> None:
    """Run all of it."""
    torch.set_num_threads(1)
    loop.start_process_group()
    for first in (0, 1):
        quantize_with_an_empty_process(first)
    options = TrainOptions(
        folder / "prepared", folder / "run", TINY, Budget(steps=STEPS), device="cpu", bf16=False, quiet=True
    )
    resume_exactly(options)
    train_stage("all", replace(options, budget=Budget(steps=2, minutes=10)))
    dist.destroy_process_group()


if __name__ == "__main__":
    main(Path(sys.argv[1]))
