"""Training HGM³: tokenizer, tokens, masked transformer, residual transformer, length estimator, then the bundle.

Each stage reads the parts of those before it in one run folder and leaves its own: `run/{stage}/part`.
"""

from __future__ import annotations

import dataclasses
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import torch
from safetensors.torch import load_file, save_file
from torch import nn

from shared.bundles import Bundle, DataSource
from shared.errors import InvalidInput
from shared.nn import distributed
from workers.hgm3.bundle import write_bundle
from workers.hgm3.config import HGM3Config
from workers.hgm3.data import CaptionData, MotionData, TokenData
from workers.hgm3.stage_masked import MaskedStage
from workers.hgm3.stage_residual import LengthStage, ResidualStage
from workers.hgm3.stage_tokenizer import TokenizerStage, reconstruction_errors
from workers.hgm3.tokenizer import Tokenizer
from workers.training.budget import Budget
from workers.training.data.prepared import PreparedData
from workers.training.loop import RunOptions, Stage, choose_device, start_process_group, train
from workers.training.parts import Part, load_part, save_part
from workers.training.texts import CaptionTexts

STAGES = ("tokenizer", "masked", "residual", "length")
BUILT_FROM = {
    "tokenizer": ("layout", "features", "joints", "tokenizer"),
    "masked": ("tokenizer", "condition", "compact", "max_frames", "masked", "predictor"),
    "residual": ("tokenizer", "condition", "compact", "max_frames", "residual"),
    "length": ("condition", "max_frames", "length_hidden"),
}
"""Fields of the configuration that each stage's networks are built from; how stages were optimised may differ."""
TOKENS = "tokens.safetensors"
REPOSITORY = Path(__file__).resolve().parents[2]


@dataclass(frozen=True)
class TrainOptions:
    """What the command line chooses for any stage."""

    prepared: Path
    run: Path  # one folder for all stages of a bundle
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
    captions = CaptionData.load(texts, options.config.condition, device)
    tokenizer = load_tokenizer(options, data)
    tokens = load_tokens(options, tokenizer, data)
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
        InvalidInput: no minutes are given.
    """
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
    stage = TokenizerStage(options.config, data)
    metrics = _run(stage, options)
    metrics |= tokenizer_test(stage.module, options.config, data)
    _finish(stage.module, options, stage.name, metrics, data.sha256)
    return metrics


def tokenizer_test(tokenizer: Tokenizer, config: HGM3Config, data: MotionData) -> dict[str, float]:
    """Reconstruction errors on the captured test clips."""
    errors = reconstruction_errors(tokenizer, config, data, data.originals("test"))
    return {f"test/{name}": value for name, value in errors.items()}


def load_tokenizer(options: TrainOptions, data: MotionData) -> Tokenizer:
    """The run's trained tokenizer, with the statistics of the data it was trained on.

    Raises:
        NotFound: not trained yet.
        InvalidInput: trained with another configuration.
    """
    part = load_part(options.run / "tokenizer" / "part")
    _same_config(part, "tokenizer", options.config, options.run / "tokenizer")
    tokenizer = Tokenizer(options.config).to(data.features.device)
    tokenizer.load_state_dict(part.state)
    return tokenizer.eval().requires_grad_(False)


def load_tokens(options: TrainOptions, tokenizer: Tokenizer, data: MotionData) -> TokenData:
    """Tokens of all clips: encoded once for a tokenizer and its data, then read from the run folder."""
    file = options.run / TOKENS
    key = f"{data.sha256}:{_fingerprint(tokenizer)}"
    if file.is_file():
        values = load_file(file, device=str(data.features.device))
        if bytes(values.pop("key").cpu().numpy().tobytes()).decode() == key:
            return TokenData(**{name: value.long() for name, value in values.items()})
    tokens = TokenData.encode(tokenizer, data)
    if distributed.rank() == 0:
        values = {
            "tokens": tokens.tokens.to(torch.int16),
            "starts": tokens.starts.int(),
            "lengths": tokens.lengths.int(),
            "key": torch.tensor(list(key.encode()), dtype=torch.uint8),
        }
        temporary = file.with_suffix(".part")
        save_file({name: value.cpu().contiguous() for name, value in values.items()}, temporary)
        temporary.replace(file)
    return tokens


def assemble(
    prepared: Path, run: Path, bundle: Path, config: HGM3Config, *, card: str | None = None, overwrite: bool = False
) -> Bundle:
    """Write the bundle from the parts of a run.

    Raises:
        NotFound: a stage has not finished.
        InvalidInput: parts of different configurations.
    """
    data = PreparedData.open(prepared)
    parts = {name: load_part(run / name / "part") for name in STAGES}
    for name, part in parts.items():
        _same_config(part, name, config, run / name)
    masked = parts["masked"].state
    states = {
        "tokenizer": dict(parts["tokenizer"].state),
        "masked": _under(masked, "masked."),
        "predictor": _under(masked, "teacher."),
        "residual": parts["residual"].state,
        "length": parts["length"].state,
    }
    statistics = (states["tokenizer"].pop("mean").numpy(), states["tokenizer"].pop("std").numpy())
    metrics = {f"{stage}/{k}": v for stage, part in parts.items() for k, v in part.metrics.items()}
    sha256 = data.manifest.files  # the data's own hashes
    licences = sorted({source.licence for source in data.manifest.sources})
    sources = tuple(
        DataSource(name=s.name, licence=s.licence, credit=s.credit, sha256=sha256["features.npy"].sha256)
        for s in data.manifest.sources
    )
    return write_bundle(
        bundle,
        config,
        states,
        statistics,
        text=CaptionTexts.load(data).spec,
        card=card,
        overwrite=overwrite,
        licence=_terms(licences),
        data=sources,
        metrics=metrics,
        training={"commit": _commit(), "budgets": {name: part.budget for name, part in parts.items()}},
    )


def _run(stage: Stage, options: TrainOptions) -> dict[str, float]:
    return train(stage, options.options(stage.name), options.config.to_dict())


def _finish(module: nn.Module, options: TrainOptions, name: str, metrics: dict[str, float], data_sha256: str) -> None:
    if distributed.rank() == 0:
        budget = {"steps": options.budget.steps, "minutes": options.budget.minutes, "seed": options.seed}
        part = Part(module.state_dict(), options.config.to_dict(), metrics, data_sha256, budget)
        save_part(options.run / name / "part", part)


def _same_config(part: Part, name: str, config: HGM3Config, where: Path) -> None:
    """Refuse a part of stage `name` whose networks were built from other values than `config`'s."""
    theirs = HGM3Config.from_dict(part.config)
    differ = [field for field in BUILT_FROM[name] if getattr(theirs, field) != getattr(config, field)]
    if differ:
        raise InvalidInput(
            f"was trained with another {differ[0]}", where=str(where), hint="Use one configuration for all stages."
        )


def _under(state: dict[str, torch.Tensor], prefix: str) -> dict[str, torch.Tensor]:
    return {name.removeprefix(prefix): value for name, value in state.items() if name.startswith(prefix)}


def _fingerprint(tokenizer: Tokenizer) -> str:
    total = sum(float(value.double().abs().sum()) for value in tokenizer.state_dict().values())
    return f"{total:.6f}"


def _terms(licences: Sequence[str]) -> str:
    """The strictest terms of the sources, as an SPDX name."""
    return "CC-BY-NC-4.0" if any("NC" in licence for licence in licences) else licences[0]


def _commit() -> str | None:
    try:
        found = subprocess.run(
            ["git", "rev-parse", "HEAD"], cwd=REPOSITORY, capture_output=True, text=True, check=True, timeout=10
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return found.stdout.strip()
