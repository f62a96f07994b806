"""The training loop shared by all stages: a stage defines a loss, the loop runs it.

Resuming is exact because no random state is carried along: batches and torch's generator are seeded from (seed, step,
rank) at every step. With a budget in minutes the schedules depend on the clock, and runs differ.
"""

from __future__ import annotations

import json
import math
import os
import time
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import structlog
import torch
import torch.distributed as dist
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn
from torch import Tensor, nn
from torch.utils.tensorboard import SummaryWriter

from marey.core.errors import InvalidInput, MareyError
from marey.nn import distributed
from marey.nn.devices import fast_bf16
from marey.nn.ema import WeightAverage
from marey.training.budget import Budget, learning_rate
from marey.training.checkpoint import TrainingState, load_checkpoint, restore_previous, save_checkpoint
from marey.training.cuda_graphs import RecordedSteps, StepResult
from marey.training.stages import RecordableStage, SplitStage, StepContext, TrainingStage

log = structlog.get_logger()


@dataclass(frozen=True)
class RunOptions:
    """Options of a run; only seed, budget and precision change the trained weights."""

    folder: Path
    budget: Budget
    seed: int = 0
    resume: bool = False
    bf16: bool = True  # where it is fast: processors without its instructions take ten times as long
    checkpoint_minutes: float = 3.0
    validate_times: int = 8  # over the whole budget, the end included
    log_every: int = 20
    quiet: bool = False
    micro_batch: int | None = None  # samples of a forward and backward pass; None = the whole batch
    record: bool = True  # steps as CUDA graphs, where device and stage allow it


def start_process_group() -> None:
    """Join the process group if started by torchrun; otherwise do nothing."""
    if int(os.environ.get("WORLD_SIZE", "1")) > 1 and not dist.is_initialized():
        dist.init_process_group("nccl" if torch.cuda.is_available() else "gloo")


def train(stage: TrainingStage, options: RunOptions, config: dict[str, Any]) -> dict[str, float]:
    """Train `stage` until the budget is used; return its last validation metrics.

    Afterwards the module holds the averaged weights.

    `folder/checkpoint` holds the state to resume from; `folder/tensorboard` the curves.

    Raises:
        MareyError: the loss is no longer finite.
    """
    return _Run(stage, options, config).execute()


class _Run:
    def __init__(self, stage: TrainingStage, options: RunOptions, config: dict[str, Any]) -> None:
        self.stage, self.options = stage, options
        if options.micro_batch is not None and not isinstance(stage, SplitStage):
            hint = "Give it to a stage alone, and train the others without."
            raise InvalidInput(f"the batches of {stage.name} cannot be split", where="--micro-batch", hint=hint)
        self.config: dict[str, Any] = json.loads(json.dumps(config))  # tuples become lists, as in a checkpoint
        o = stage.optimisation
        self.device = next(stage.module.parameters()).device
        trained = [p for group in stage.clip_groups() for p in group]
        recordable = _recordable(stage, options, self.device)
        self.optimizer = torch.optim.AdamW(
            _decay_groups(trained, o.weight_decay), lr=o.learning_rate, betas=o.betas, fused=True,
            capturable=recordable is not None,
        )  # fmt: skip
        self.average = WeightAverage(stage.module, o.ema)
        self.step = 0
        self.seconds = 0.0
        self.rate = 0.0
        self.metrics: dict[str, float] = {}
        self.checkpoint = options.folder / "checkpoint"
        self.main = distributed.rank() == 0
        if options.resume:
            self._restore()
        else:
            for tensor in stage.module.state_dict().values():
                distributed.broadcast(tensor)
        self.recorded: RecordedSteps | None = None
        if recordable is not None:
            self.recorded = RecordedSteps(recordable, self.optimizer, self.average, self._autocast)

    def _restore(self) -> None:
        """Load the checkpoint.

        Raises:
            InvalidInput: it is of another run.
        """
        stage, seed = self.stage, self.options.seed
        if self.main:
            restore_previous(self.checkpoint)
        distributed.barrier()
        state = load_checkpoint(self.checkpoint, stage.module, self.average, self.optimizer)
        if (state.stage, state.seed, state.config) != (stage.name, seed, self.config):
            raise InvalidInput(
                "the checkpoint was made with another stage, seed or configuration",
                where=str(self.checkpoint),
                hint="Resume with the options of the first start, or start in another folder.",
            )
        self.step, self.seconds, self.metrics = state.step, state.seconds, state.metrics

    @property
    def fraction(self) -> float:
        return self.options.budget.fraction(self.step, self.seconds)

    def execute(self) -> dict[str, float]:
        options = self.options
        options.folder.mkdir(parents=True, exist_ok=True)
        writer = SummaryWriter(str(options.folder / "tensorboard"), purge_step=self.step) if self.main else None
        validated = math.floor(self.fraction * options.validate_times)
        saved = time.monotonic()
        # without a process group every process has its own clock: rank 0's is used (see _tick)
        with _progress(self.main and not options.quiet) as progress:
            bar = progress.add_task(self.stage.name, total=1.0, note="")
            while self.fraction < 1.0:
                result = self._one_step()
                if self.step % options.log_every == 0 or self.step == 1:
                    self._check_finite(result)  # recorded steps run ahead of the host until here
                    if writer:
                        self._write_logs(writer, progress, bar, result)
                due = math.floor(self.fraction * options.validate_times + 1e-9)
                if due > validated or self.fraction >= 1.0:
                    validated = due
                    self._validate(writer)
                if time.monotonic() - saved > 60 * options.checkpoint_minutes or self.fraction >= 1.0:
                    saved = time.monotonic()
                    self._check_finite(result)
                    self._save()
        if writer:
            writer.close()
        self.average.assign()
        self.stage.module.eval()
        return self.metrics

    def _one_step(self) -> StepResult:
        started = time.monotonic()
        stage, o = self.stage, self.stage.optimisation
        fraction = self.fraction
        self.rate = learning_rate(
            o.learning_rate, fraction, self.step, warmup_steps=o.warmup_steps, warmup_share=o.warmup_share,
            decay=o.decay, final=o.final,
        )  # fmt: skip
        entropy = np.random.SeedSequence([self.options.seed, self.step, distributed.rank()])
        rng = np.random.default_rng(entropy)
        torch.manual_seed(int(rng.integers(2**62)))
        context = StepContext(self.step, fraction, rng)
        stage.module.train()
        result = self.recorded.step(context, self.rate) if self.recorded else self._eager_step(context)
        stage.after_step(context)
        self.step += 1
        self._tick(time.monotonic() - started)
        return result

    def _eager_step(self, context: StepContext) -> StepResult:
        stage = self.stage
        for group in self.optimizer.param_groups:
            group["lr"] = self.rate
        self.optimizer.zero_grad(set_to_none=True)
        logs = self._backward(context)
        groups = stage.clip_groups()
        for group in groups:
            distributed.average_gradients(group)
        norms = tuple(nn.utils.clip_grad_norm_(group, stage.optimisation.clip) for group in groups)
        result = StepResult(logs, norms)
        self._check_finite(result)
        self.optimizer.step()
        self.average.update(self.step)
        return result

    def _check_finite(self, result: StepResult) -> None:
        if not all(bool(torch.isfinite(norm)) for norm in result.norms):
            raise MareyError(
                f"the gradient of {self.stage.name} is not finite at step {self.step}",
                where=str(self.options.folder),
                hint="Resume from the last checkpoint with a smaller learning rate.",
            )

    def _backward(self, context: StepContext) -> Mapping[str, Tensor]:
        """Compute the gradients of one batch; return values to log."""
        stage, size = self.stage, self.options.micro_batch
        if size is None:
            with self._autocast():
                loss, logs = stage.loss(context)
            loss.backward()
            return logs
        assert isinstance(stage, SplitStage)  # `_Run` has refused others
        parts, total = stage.parts(context, size), dict[str, Tensor]()
        while True:
            with self._autocast():
                part = next(parts, None)
            if part is None:
                return total
            loss, logs = part
            loss.backward()
            total = {name: total.get(name, torch.zeros_like(value)) + value for name, value in logs.items()}
            del part, loss  # frees what the part saved before the next one saves its own

    def _tick(self, seconds: float) -> None:
        """Advance the training clock, the same on all processes."""
        if distributed.is_distributed():
            elapsed = torch.tensor(seconds, dtype=torch.float64, device=self.device)
            seconds = float(distributed.broadcast(elapsed))
        self.seconds += seconds

    def _autocast(self) -> Any:
        if not (self.options.bf16 and fast_bf16(self.device)):
            return nullcontext()
        return torch.autocast(self.device.type, dtype=torch.bfloat16)

    def _validate(self, writer: SummaryWriter | None) -> None:
        started = time.monotonic()
        self.stage.module.eval()
        with self.average.applied(), torch.no_grad(), self._autocast():
            self.metrics = {k: float(v) for k, v in self.stage.validate().items()}
        self._tick(time.monotonic() - started)
        if writer:
            for name, value in self.metrics.items():
                writer.add_scalar(f"validation/{name}", value, self.step)
            writer.flush()
            shown = {k: round(v, 4) for k, v in self.metrics.items()}
            log.info("validated", stage=self.stage.name, step=self.step, minutes=round(self.seconds / 60, 1), **shown)

    def _save(self) -> None:
        if not self.main:
            return
        state = TrainingState(
            self.stage.name, self.step, self.seconds, self.options.seed, self.config, dict(self.metrics)
        )
        save_checkpoint(self.checkpoint, state, self.stage.module, self.average, self.optimizer)

    def _write_logs(self, writer: SummaryWriter, progress: Progress, bar: TaskID, result: StepResult) -> None:
        logs = {name: float(value) for name, value in result.logs.items()}
        for name, value in (logs | {"rate": self.rate, "gradient_norm": float(result.norms[0])}).items():
            writer.add_scalar(f"train/{name}", value, self.step)
        note = f"step {self.step}  loss {logs.get('loss', math.nan):.4f}"
        progress.update(bar, completed=self.fraction, note=note)


def _recordable(stage: TrainingStage, options: RunOptions, device: torch.device) -> RecordableStage | None:
    """Return the stage if its steps are recorded: whole batches of one process on a GPU, with their activations."""
    if device.type != "cuda" or not options.record or options.micro_batch is not None or distributed.is_distributed():
        return None
    if any(getattr(module, "recompute", False) for module in stage.module.modules()):
        return None
    return stage if isinstance(stage, RecordableStage) and stage.recordable else None


def _decay_groups(parameters: Sequence[nn.Parameter], weight_decay: float) -> list[dict[str, Any]]:
    """Weight decay on matrices only, not on biases and norms."""
    return [
        {"params": [p for p in parameters if p.dim() >= 2], "weight_decay": weight_decay},
        {"params": [p for p in parameters if p.dim() < 2], "weight_decay": 0.0},
    ]


def _progress(shown: bool) -> Progress:
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn(), TextColumn("{task.fields[note]}"))
    return Progress(*columns, disable=not shown)
