"""Train a bundle stage by stage in one run folder: each stage reads the parts before it and writes its own.

run/{stage}/checkpoint    to resume from
run/{stage}/tensorboard   the curves
run/{stage}/part          the finished part
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Generic, Literal, Protocol, TypeVar

import structlog
import torch
from torch import nn

from marey.bundles import Bundle
from marey.bundles.eight_bit import restore
from marey.core.errors import InvalidInput
from marey.data.licences import Terms, check_mix, tier_of
from marey.data.prepared import PreparedData, read_manifest
from marey.nn import distributed
from marey.nn.devices import choose_device, fast_bf16
from marey.nn.growing import grow, take
from marey.training.budget import Budget
from marey.training.loop import RunOptions, train
from marey.training.memory import MemoryModel, counted_for, device_memory
from marey.training.optimisation import StageConfig
from marey.training.parts import TrainedPart, load_part, load_sources, save_part
from marey.training.stages import TrainingStage

log = structlog.get_logger()


class TrainableConfig(Protocol):
    """A model's configuration."""

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON values."""
        ...


C = TypeVar("C", bound=TrainableConfig)
N = TypeVar("N", bound=nn.Module)
Contra = TypeVar("Contra", contravariant=True)


class MemoryOf(Protocol[Contra]):
    """Counts the memory of a stage."""

    def __call__(self, config: Contra, *, bf16: bool) -> MemoryModel:
        """Return its memory at any number of samples; with `bf16`, matrices are in bfloat16."""
        ...


@dataclass(frozen=True)
class TrainOptions(Generic[C]):
    """Command-line options common to all stages."""

    prepared: Path
    run: Path  # one folder for all stages of a bundle
    config: C
    budget: Budget
    seed: int = 0
    resume: bool = False
    warm: bool = False  # start from the weights of the stage's finished part in `run`
    origin: Bundle | None = None  # start from those weights of its part that fit, of another model perhaps
    device: str = "auto"
    threads: int = 0
    bf16: bool = True
    quiet: bool = False
    micro_batch: int | Literal["auto"] | None = None  # samples of a pass; auto = as many as fit the device's memory
    recompute: bool = False  # activations in the backward pass: less memory, more time
    record: bool = True  # steps as CUDA graphs, where device and stage allow it
    checkpoint_minutes: float = 3.0  # minutes between checkpoints

    def options(self, stage: str) -> RunOptions:
        """Return the loop's options for a stage."""
        if self.micro_batch == "auto":
            hint = "Name a number, or give auto to the stages of transformers alone."
            raise InvalidInput("auto is for stages whose memory is estimated", where="--micro-batch", hint=hint)
        return RunOptions(
            self.run / stage, self.budget, seed=self.seed, resume=self.resume, bf16=self.bf16, quiet=self.quiet,
            micro_batch=self.micro_batch, record=self.record, checkpoint_minutes=self.checkpoint_minutes,
        )  # fmt: skip


def fit_micro_batch(options: TrainOptions[C], memory: MemoryOf[C]) -> TrainOptions[C]:
    """Return the options with a number of samples a pass in place of `auto`: as many as fit the device's memory.

    Raises:
        InvalidInput: not even one fits.
    """
    if options.micro_batch != "auto":
        return options
    device = choose_device(options.device)
    with counted_for(device):
        model = memory(options.config, bf16=options.bf16 and fast_bf16(device))
    samples = model.fit(device_memory(device), recompute=options.recompute).samples
    log.info("samples of a pass", stage=model.stage, samples=samples, batch=model.batch)
    return dataclasses.replace(options, micro_batch=samples)


def choose_budget(config: object, stage: str, prepared: Path, steps: int | None, minutes: float | None) -> Budget:
    """Return the budget of a stage: steps and minutes as given; where neither is, the epochs of its configuration.

    Raises:
        InvalidInput: there is none, or it is not positive.
    """
    own: StageConfig | None = getattr(config, f"train_{stage}", None)
    if steps is None and minutes is None and own is not None and own.epochs:
        return Budget.of_epochs(own.epochs, len(PreparedData.open(prepared).split("train")), own.batch)
    return Budget(steps, minutes)


@dataclass(frozen=True)
class TrainingRecipe(Generic[C]):
    """The training stages of a model.

    Attributes:
        read: parses a configuration from its plain values.
        built_from: for each stage in training order, the fields of the configuration that determine its networks; how
            stages were optimised may differ.
        shares: shares of the stages in the minutes of a whole training.
        most_steps: upper limits of steps for stages that overfit beyond them.
        grows: for stages whose transformer may be larger than in the part of a warm start, its field.
        names: beginnings of names of weights that bundles of other models call otherwise, and what they call them.
    """

    read: Callable[[Mapping[str, Any]], C]
    built_from: Mapping[str, tuple[str, ...]]
    shares: Mapping[str, float]
    most_steps: Mapping[str, int] = field(default_factory=dict[str, int])
    grows: Mapping[str, str] = field(default_factory=dict[str, str])
    names: Mapping[str, str] = field(default_factory=dict[str, str])

    @property
    def stages(self) -> tuple[str, ...]:
        """Return stages in training order."""
        return tuple(self.built_from)

    def check_name(self, name: str) -> None:
        """Refuse an unknown stage."""
        if name not in self.stages:
            raise InvalidInput(f"unknown stage {name!r}", hint=f"Known: {', '.join(self.stages)}, all.")

    def part(self, name: str, config: C, run: Path) -> TrainedPart:
        """Return the finished part of a stage in a run folder.

        Raises:
            NotFound: not trained yet.
            InvalidInput: its networks were built from other values than `config`'s.
        """
        return self._part(name, config, run, grows=None)

    def trained(self, name: str, network: N, options: TrainOptions[C]) -> N:
        """Return a stage's network, built from the configuration, with the weights of its finished part, in evaluation
        mode. See `part` for what is raised."""
        network.load_state_dict(self.part(name, options.config, options.run).state)
        return network.eval().requires_grad_(False)

    def _part(self, name: str, config: C, run: Path, *, grows: str | None) -> TrainedPart:
        part = load_part(run / name / "part")
        theirs = self.read(part.config)
        differ = [f for f in self.built_from[name] if not _fits(getattr(theirs, f), getattr(config, f), f == grows)]
        if differ:
            raise InvalidInput(
                f"was trained with another {differ[0]}",
                where=str(run / name),
                hint="Use one configuration for all stages.",
            )
        return part

    def train(self, stage: TrainingStage, options: TrainOptions[C]) -> dict[str, float]:
        """Train one stage; with `warm` from its finished part, whose transformer may have been smaller. See `part` for
        what is raised then.

        Raises:
            InvalidInput: the licences of the data and of what it is trained upon exclude each other; both `warm` and
                `origin`; or nothing of `origin` fits.
        """
        ancestors(options, stage.name)
        if options.warm:
            part = self._part(stage.name, options.config, options.run, grows=self.grows.get(stage.name))
            stage.module.load_state_dict(grow(part.state, stage.module.state_dict()))
        if options.origin is not None:
            begin_from(options.origin, stage.name, stage.module, self.names)
        if options.recompute:
            set_recompute(stage.module)
        return train(stage, options.options(stage.name), options.config.to_dict())


def _fits(theirs: Any, ours: Any, grows: bool) -> bool:
    """Return True if equal values built the networks, or if the transformer of the one grows into that of the other."""
    if theirs == ours or not grows:
        return bool(theirs == ours)
    larger = dataclasses.replace(theirs, layers=ours.layers, feedforward=ours.feedforward)
    return bool(larger == ours and ours.norm_first)


def ancestors(options: TrainOptions[Any], name: str) -> tuple[Terms, ...]:
    """Terms of the data behind a stage: of the prepared folder, and of the parts in the run. Its own finished part
    counts with `warm` alone; else it is replaced.

    Raises:
        InvalidInput: their licences exclude each other.
    """
    found = {(terms.name, terms.licence): terms for terms in read_manifest(options.prepared).terms}
    if options.origin is not None:
        found = {(terms.name, terms.licence): terms for terms in bundle_terms(options.origin)} | found
    for file in sorted(options.run.glob("*/part/part.json")):
        if file.parent.parent.name != name or options.warm:
            for terms in load_sources(file):
                found.setdefault((terms.name, terms.licence), terms)
    check_mix(found.values(), where=str(options.run))
    return tuple(found.values())


def bundle_terms(bundle: Bundle) -> tuple[Terms, ...]:
    """Terms of the data behind a bundle."""
    return tuple(Terms(d.name, d.name, d.licence, d.credit, "", tier_of(d.licence)) for d in bundle.manifest.data)


def begin_from(origin: Bundle, part: str, network: nn.Module, names: Mapping[str, str]) -> None:
    """Copy the weights of a bundle's part that fit by name and shape.

    Raises:
        InvalidInput: they are less than half of the network's.
        InvalidBundle: no such part, or damaged.
    """
    where = f"{origin.path}: {part}"
    stored = {name: torch.tensor(value) for name, value in restore(origin.tensors(part), where=where).items()}
    copied = take(network, stored, names)
    sizes = {name: weight.numel() for name, weight in network.named_parameters()}
    share = sum(sizes[name] for name in copied) / sum(sizes.values())
    if share < 0.5:
        hint = "Take a bundle of equal widths."
        raise InvalidInput("fits in less than half of this stage's weights", where=where, hint=hint)
    log.info("took weights of another bundle", bundle=origin.reference, share=round(share, 2))


def finish(module: nn.Module, options: TrainOptions[Any], name: str, metrics: dict[str, float], sha256: str) -> None:
    """Write a stage's part: averaged weights, configuration, metrics, and the hash of the data."""
    if distributed.rank() == 0:
        budget = {"steps": options.budget.steps, "minutes": options.budget.minutes, "seed": options.seed}
        sources = ancestors(options, name)
        part = TrainedPart(module.state_dict(), options.config.to_dict(), metrics, sha256, budget, sources)
        save_part(options.run / name / "part", part)
    distributed.barrier()  # the next stage reads the part in every process


def train_all(
    recipe: TrainingRecipe[C], train_stage: Callable[[str, TrainOptions[C]], dict[str, float]], options: TrainOptions[C]
) -> dict[str, float]:
    """Train every unfinished stage in order; `options.budget` is for all of them together.

    A second call after a kill continues. Only minutes are shared among stages: steps count for each stage.

    Raises:
        InvalidInput: no minutes are given, or a warm start is requested.
    """
    if options.warm:
        raise InvalidInput("--warm needs a single stage", hint="Give --warm to one stage at a time.")
    minutes = options.budget.minutes
    if minutes is None:
        raise InvalidInput("training all stages needs a budget in minutes", hint="Give --max-minutes.")
    metrics: dict[str, float] = {}
    for name in recipe.stages:
        if (options.run / name / "part" / "part.json").is_file():
            continue
        steps, most = options.budget.steps, recipe.most_steps.get(name)
        if most is not None:
            steps = min(steps or most, most)
        budget = Budget(steps, minutes * recipe.shares[name])
        started = (options.run / name / "checkpoint" / "state.json").is_file()
        found = train_stage(name, dataclasses.replace(options, budget=budget, resume=started))
        metrics |= {f"{name}/{metric}": value for metric, value in found.items()}
    return metrics


def set_recompute(module: nn.Module) -> None:
    """Let the networks of a stage compute activations again in the backward pass, where they can.

    Raises:
        InvalidInput: none of them can.
    """
    able = [each for each in module.modules() if hasattr(each, "recompute")]
    if not able:
        raise InvalidInput("this stage has no network whose activations are computed again", where="--recompute")
    for each in able:
        each.recompute = True  # pyright: ignore[reportAttributeAccessIssue, reportArgumentType]


def use_threads(threads: int) -> None:
    """Set the number of torch threads; 0 keeps torch's default."""
    if threads:
        torch.set_num_threads(threads)
