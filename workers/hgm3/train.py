"""Training HGM³: tokenizer, tokens, masked transformer, residual transformer, length estimator, then the bundle.

Each stage reads the parts of those before it in one run folder and leaves its own: `run/{stage}/part`.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import nn

from shared.errors import InvalidInput
from shared.nn import distributed
from workers.hgm3.assembly import STAGES, same_config
from workers.hgm3.config import HGM3Config
from workers.hgm3.data import CaptionData
from workers.hgm3.stage_masked import MaskedStage
from workers.hgm3.stage_residual import LengthStage, ResidualStage
from workers.hgm3.tokenizer import Tokenizer
from workers.training.budget import Budget
from workers.training.loop import RunOptions, Stage, choose_device, start_process_group, train
from workers.training.motions import MotionData, load_tokens
from workers.training.parts import Part, load_part, save_part
from workers.training.texts import CaptionTexts
from workers.training.tokenizing import TokenizerStage


@dataclass(frozen=True)
class TrainOptions:
    """What the command line chooses for any stage."""

    prepared: Path
    run: Path  # one folder for all stages of a bundle
    config: HGM3Config
    budget: Budget
    seed: int = 0
    resume: bool = False
    warm: bool = False  # start from the weights of the stage's finished part in `run`
    device: str = "auto"
    threads: int = 0
    bf16: bool = True
    quiet: bool = False

    def options(self, stage: str) -> RunOptions:
        """The loop's options for a stage."""
        return RunOptions(
            self.run / stage, self.budget, seed=self.seed, resume=self.resume, bf16=self.bf16, quiet=self.quiet
        )


def train_stage(name: str, options: TrainOptions) -> dict[str, float]:
    """Train one stage and write its part; returns its metrics. `all` is `train_all`.

    Raises:
        NotFound: a stage it builds on has not finished, or captions have no text features.
        InvalidInput: no such stage, or parts of another configuration.
    """
    if name == "all":
        return train_all(options)
    if name not in STAGES:
        raise InvalidInput(f"there is no stage {name!r}", hint=f"Known: {', '.join(STAGES)}, all.")
    start_process_group()
    if options.threads:
        torch.set_num_threads(options.threads)
    device = choose_device(options.device)
    data = MotionData.load(options.prepared, device)
    torch.manual_seed(options.seed)
    if name == "tokenizer":
        return _train_tokenizer(options, data)
    texts = CaptionTexts.load(data.prepared)
    captions = CaptionData.of(texts, options.config.condition, device)
    tokenizer = load_tokenizer(options, data)
    tokens = load_tokens(options.run, tokenizer, data)
    codebooks = tokenizer.quantizer.codebooks
    torch.manual_seed(options.seed)
    clips = data.prepared.clips
    data = dataclasses.replace(data, features=data.features[:0])  # the tokens are enough: give the memory back
    if name == "masked":
        stage = MaskedStage(options.config, clips, tokens, captions)
    elif name == "residual":
        stage = ResidualStage(options.config, clips, tokens, captions, codebooks)
    else:
        stage = LengthStage(options.config, clips, tokens, captions)
    metrics = _run(stage, options)
    _finish(stage.module, options, name, metrics, data.sha256)
    return metrics


SHARES = {"tokenizer": 0.42, "masked": 0.38, "residual": 0.18, "length": 0.02}
"""How the minutes of a whole training are dealt out."""
LENGTH_STEPS = 1000  # beyond them the length estimator learns the training clips by heart (validation 3.17 → 3.52)


def train_all(options: TrainOptions) -> dict[str, float]:
    """Train every stage that has not finished, one after another; `options.budget` is for all of them together.

    Called again after a kill it goes on where it stopped. Only minutes are dealt out: steps count for each stage.

    Raises:
        InvalidInput: no minutes are given, or a warm start is wanted.
    """
    if options.warm:
        raise InvalidInput("all stages at once start from nothing", hint="Give --warm to one stage at a time.")
    minutes = options.budget.minutes
    if minutes is None:
        raise InvalidInput("training all stages needs minutes to deal out", hint="Give --max-minutes.")
    metrics: dict[str, float] = {}
    for name in STAGES:
        if (options.run / name / "part" / "part.json").is_file():
            continue
        steps = options.budget.steps
        if name == "length":
            steps = min(steps or LENGTH_STEPS, LENGTH_STEPS)
        budget = Budget(steps, minutes * SHARES[name])
        started = (options.run / name / "checkpoint" / "state.json").is_file()
        found = train_stage(name, dataclasses.replace(options, budget=budget, resume=started))
        metrics |= {f"{name}/{metric}": value for metric, value in found.items()}
    return metrics


def _train_tokenizer(options: TrainOptions, data: MotionData) -> dict[str, float]:
    stage = TokenizerStage(options.config, data, Tokenizer(options.config))
    metrics = _run(stage, options) | stage.test()
    _finish(stage.module, options, stage.name, metrics, data.sha256)
    return metrics


def load_tokenizer(options: TrainOptions, data: MotionData) -> Tokenizer:
    """The run's trained tokenizer, with the statistics of the data it was trained on.

    Raises:
        NotFound: not trained yet.
        InvalidInput: trained with another configuration.
    """
    part = load_part(options.run / "tokenizer" / "part")
    same_config(part, "tokenizer", options.config, options.run / "tokenizer")
    tokenizer = Tokenizer(options.config).to(data.features.device)
    tokenizer.load_state_dict(part.state)
    return tokenizer.eval().requires_grad_(False)


def _run(stage: Stage, options: TrainOptions) -> dict[str, float]:
    if options.warm:
        part = load_part(options.run / stage.name / "part")
        same_config(part, stage.name, options.config, options.run / stage.name)
        stage.module.load_state_dict(part.state)
    return train(stage, options.options(stage.name), options.config.to_dict())


def _finish(module: nn.Module, options: TrainOptions, name: str, metrics: dict[str, float], data_sha256: str) -> None:
    if distributed.rank() == 0:
        budget = {"steps": options.budget.steps, "minutes": options.budget.minutes, "seed": options.seed}
        part = Part(module.state_dict(), options.config.to_dict(), metrics, data_sha256, budget)
        save_part(options.run / name / "part", part)
