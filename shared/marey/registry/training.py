"""Trainings as the registry knows them: stages, options, and references to their functions.

A model's training is a part of its spec. What is trained and is no generator model, such as the evaluator, is
registered by one line of its own:

    [project.entry-points."marey.trainings"]
    evaluator = "marey.evaluator.spec:TRAINING"
"""

from __future__ import annotations

from dataclasses import dataclass

from marey.registry.plugins import PlugIns


@dataclass(frozen=True)
class Stage:
    """One step of training: `marey train MODEL NAME`."""

    name: str
    help: str


@dataclass(frozen=True)
class Choice:
    """An option of a model's training that takes one of several words; none given = as the configuration says."""

    name: str
    values: tuple[str, ...]
    help: str


@dataclass(frozen=True)
class Training:
    """How bundles are trained, of a model or of what is registered in `marey.trainings`. All functions are references,
    `module:attribute`.

    Attributes:
        help: of the group of commands.
        stages: in training order; one named `all` runs every other.
        config: `(name, **choices) -> configuration`, a `marey.core.configs.ModelConfig` with one
            `train_<stage>: StageConfig` a stage.
        train: `(stage, TrainOptions) -> {metric: value}`.
        assemble: `(prepared, run, output, configuration, *, card, overwrite) -> Bundle`.
        unpack: `(bundle, run) -> configuration`; None = bundles cannot be trained further.
        choices: passed on to `config` by name.
        bundle_help: of the command `bundle`.
        memory: `(configuration, *, bf16) -> marey.training.memory.MemoryModel` of the stage that needs most; None = no
            command `memory`.
    """

    help: str
    stages: tuple[Stage, ...]
    config: str
    train: str
    assemble: str
    unpack: str | None = None
    choices: tuple[Choice, ...] = ()
    bundle_help: str = "Write the bundle from the parts of a run."
    memory: str | None = None


TRAININGS = PlugIns("marey.trainings", Training)
