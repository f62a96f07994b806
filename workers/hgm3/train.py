"""`marey train hgm3 …`: tokenizer, tokens, masked transformer, residual transformer, length estimator, bundle."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import torch

from shared.nn import distributed
from workers.hgm3.config import HGM3Config
from workers.hgm3.data import MotionData
from workers.hgm3.stage_tokenizer import TokenizerStage, reconstruction_errors
from workers.training.budget import Budget
from workers.training.loop import RunOptions, Stage, choose_device, start_process_group, train
from workers.training.parts import save_part


@dataclass(frozen=True)
class TrainOptions:
    """What the command line chooses for any stage."""

    prepared: Path
    run: Path  # one folder for all stages of a bundle; each writes a subfolder
    config: HGM3Config
    budget: Budget
    seed: int = 0
    resume: bool = False
    device: str = "auto"
    threads: int = 0
    bf16: bool = True
    quiet: bool = False

    def options(self, stage: str) -> RunOptions:
        """The loop's options for a stage."""
        return RunOptions(
            self.run / stage, self.budget, seed=self.seed, resume=self.resume, bf16=self.bf16, quiet=self.quiet
        )


def train_tokenizer(options: TrainOptions) -> dict[str, float]:
    """Train the tokenizer and write it to `run/tokenizer/part`, with its errors on the test split."""
    device = _begin(options)
    data = MotionData.load(options.prepared, device)
    torch.manual_seed(options.seed)
    stage = TokenizerStage(options.config, data)
    metrics = _run(stage, options)
    test = [c for c in data.clips if c.split == "test" and not c.mirrored and not c.spliced]
    metrics |= {f"test/{k}": v for k, v in reconstruction_errors(stage.module, options.config, data, test).items()}
    _finish(stage.module, options, "tokenizer", metrics, data.manifest_sha256)
    return metrics


def _begin(options: TrainOptions) -> torch.device:
    start_process_group()
    if options.threads:
        torch.set_num_threads(options.threads)
    return choose_device(options.device)


def _run(stage: Stage, options: TrainOptions) -> dict[str, float]:
    return train(stage, options.options(stage.name), options.config.to_dict())


def _finish(
    module: torch.nn.Module, options: TrainOptions, name: str, metrics: dict[str, float], data_sha256: str
) -> None:
    if distributed.rank() == 0:
        save_part(options.run / name / "part", module.state_dict(), options.config.to_dict(), metrics, data_sha256)
