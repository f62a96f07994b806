"""`marey train MODEL …`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, MutableMapping
from pathlib import Path
from typing import Annotated, Any, Literal

import typer
from typer.core import TyperGroup

from marey.cli import console
from marey.cli.signatures import replace_parameter
from marey.core.errors import InvalidInput
from marey.registry import Training, trainings


class TrainGroup(TyperGroup):
    """The registered trainings beside the commands for all of them; reads the registry at the first look-up."""

    _own: MutableMapping[str, Any]
    _registered: dict[str, Any] | None = None

    @property
    def commands(self) -> MutableMapping[str, Any]:
        """Commands by name: a group for each training, with the commands of the same group here, then the others."""
        if self._registered is None:
            self._registered = {name: typer.main.get_group(_group_of(name, each)) for name, each in trainings().items()}
            for name, group in self._registered.items():
                if name in self._own:
                    group.commands.update(self._own[name].commands)
        return {**self._own, **self._registered}

    @commands.setter
    def commands(self, own: MutableMapping[str, Any]) -> None:
        self._own = own


app = typer.Typer(cls=TrainGroup, help="Train a model, stage by stage, then write its bundle.", no_args_is_help=True)

Data = Annotated[Path, typer.Argument(metavar="DATA", help="A prepared folder, with its texts.")]
Run = Annotated[Path, typer.Option("--run", help="Folder of all stages of one bundle.")]
Config = Annotated[
    str,
    typer.Option(
        "--config",
        help="A preset, or a .toml file that changes one; `config` prints it with every field.",
    ),
]
Steps = Annotated[int | None, typer.Option("--steps", help="Optimiser steps.")]
Minutes = Annotated[
    float | None, typer.Option("--max-minutes", help="Minutes; schedules follow the budget that ends first.")
]
Seed = Annotated[int, typer.Option("--seed", help="Seed of weights and batches.")]
Resume = Annotated[bool, typer.Option("--resume", help="Resume from the last checkpoint.")]
Warm = Annotated[bool, typer.Option("--warm", help="Start from the weights of the stage's finished part.")]
Origin = Annotated[
    str | None,
    typer.Option(
        "--from",
        metavar="BUNDLE",
        help="Start from those weights of a bundle's part that fit, of another model perhaps: a tokenizer's "
        "convolutions, if widths are equal.",
    ),
]
Device = Annotated[str, typer.Option("--device", help="auto, cpu, cuda, cuda:1 …")]
Threads = Annotated[int, typer.Option("--threads", help="0 = torch's own choice.")]
Rate = Annotated[float | None, typer.Option("--learning-rate", help="Default: the configuration's.")]
MicroBatch = Annotated[
    str | None,
    typer.Option(
        "--micro-batch",
        metavar="N|auto",
        help="Samples of a forward and backward pass; gradients are added up over the batch. auto: as many as fit.",
    ),
]
Recompute = Annotated[
    bool, typer.Option("--recompute", help="Compute activations again in the backward pass: less memory, more time.")
]
Record = Annotated[
    bool,
    typer.Option("--record/--no-record", help="Record steps on a GPU as CUDA graphs: three times as many a second."),
]
Checkpoints = Annotated[
    float,
    typer.Option("--checkpoint-minutes", min=0.0, help="Minutes between checkpoints, which --resume goes on from."),
]
Bf16 = Annotated[bool, typer.Option("--bf16/--no-bf16", help="Use bfloat16 matrices where they are faster.")]


Output = Annotated[Path, typer.Option("-o", "--output", help="The bundle's folder, such as models/hgm3-starter.")]
Card = Annotated[Path | None, typer.Option("--card", help="A model card for the bundle; default: a generated one.")]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace an existing bundle.")]
Packed = Annotated[str, typer.Argument(metavar="BUNDLE", help="Name or path of a bundle.")]
CONFIG = "Print a configuration as a file: every field with its range and meaning, to change and give to `--config`."
MEMORY = "Estimate the memory of the stage that needs most, by counting what one pass of a few layers saves."
UNPACK = "Write the parts of a bundle into a run, to train on from them with `--warm`, on the same data or your own."


def _group_of(name: str, training: Training) -> typer.Typer:
    """Make the commands of one model: its stages, `bundle`, and `unpack` where bundles can be trained further."""
    group = typer.Typer(name=name, help=training.help, no_args_is_help=True, rich_markup_mode=None)
    for stage in training.stages:
        group.command(stage.name, help=stage.help)(_with_choices(_stage_command(training, stage.name), training))
    group.command("bundle", help=training.bundle_help)(_with_choices(_bundle_command(training), training))
    group.command("config", help=CONFIG)(_config_command(training))
    if training.memory is not None:
        group.command("memory", help=MEMORY)(_memory_command(training))
    if training.unpack is not None:

        def unpack(bundle: Packed, run: Run) -> None:
            from marey.cli.roles.training import unpack_bundle

            console.result(unpack_bundle(training, bundle, run))

        group.command("unpack", help=UNPACK)(unpack)
    return group


def _stage_command(training: Training, stage: str) -> Callable[..., None]:
    def command(
        data: Data,
        run: Run,
        config: Config = "starter",
        steps: Steps = None,
        max_minutes: Minutes = None,
        seed: Seed = 0,
        resume: Resume = False,
        warm: Warm = False,
        origin: Origin = None,
        learning_rate: Rate = None,
        device: Device = "auto",
        threads: Threads = 0,
        bf16: Bf16 = True,
        micro_batch: MicroBatch = None,
        recompute: Recompute = False,
        record: Record = True,
        checkpoint_minutes: Checkpoints = 3.0,
        as_json: console.Json = False,
        **choices: str | None,
    ) -> None:
        from marey.cli.roles.training import train_stage

        metrics = train_stage(
            training, stage, data, run, config=config, steps=steps, minutes=max_minutes, seed=seed, resume=resume,
            warm=warm, origin=origin, rate=learning_rate, device=device, threads=threads, bf16=bf16,
            choices=_given(choices), micro_batch=_micro_batch(micro_batch), recompute=recompute, record=record,
            checkpoint_minutes=checkpoint_minutes,
        )  # fmt: skip
        if as_json:
            console.result_json(metrics)
        else:
            for metric, value in metrics.items():
                console.result(f"{metric} = {value:g}")

    return command


def _bundle_command(training: Training) -> Callable[..., None]:
    def command(
        data: Data,
        run: Run,
        output: Output,
        config: Config = "starter",
        card: Card = None,
        overwrite: Overwrite = False,
        **choices: str | None,
    ) -> None:
        from marey.cli.roles.training import assemble_bundle

        made = assemble_bundle(
            training, data, run, output, config=config, card=card, overwrite=overwrite, choices=_given(choices)
        )
        console.result(made)

    return command


def _micro_batch(given: str | None) -> int | str | None:
    if given is None or given == "auto":
        return given
    if not given.isdecimal() or int(given) < 1:
        raise InvalidInput(f"{given!r} is not auto or a number of samples", where="--micro-batch")
    return int(given)


def _memory_command(training: Training) -> Callable[..., None]:
    def command(
        config: Config = "starter",
        micro_batch: MicroBatch = None,
        recompute: Recompute = False,
        gigabytes: Annotated[
            float | None, typer.Option("--gigabytes", help="Memory of the GPU, for auto; none given = this device's.")
        ] = None,
        bf16: Bf16 = True,
        as_json: console.Json = False,
    ) -> None:
        from marey.cli.roles.training import estimate_memory

        samples = _micro_batch(micro_batch)
        found = estimate_memory(training, config, samples, recompute=recompute, gigabytes=gigabytes, bf16=bf16)
        if as_json:
            console.result_json(found)
            return
        console.result(f"{found['samples']} of {found['batch']} samples a pass of the stage {found['stage']}")
        console.table(("part", "GiB"), [(name, f"{size:.2f}") for name, size in found["gib"].items()])

    return command


def _config_command(training: Training) -> Callable[..., None]:
    def command(config: Config = "starter") -> None:
        from marey.cli.roles.training import show_config

        console.result(show_config(training, config).rstrip("\n"))

    return command


def _given(choices: Mapping[str, str | None]) -> dict[str, str]:
    return {name: value for name, value in choices.items() if value is not None}


def _with_choices(command: Callable[..., None], training: Training) -> Callable[..., None]:
    """Give a command the model's own options in place of its `**choices`."""
    own: dict[str, tuple[Any, object]] = {
        choice.name: (
            Annotated[
                Literal[choice.values] | None,  # pyright: ignore[reportInvalidTypeForm]
                typer.Option(f"--{choice.name}", help=choice.help),
            ],
            None,
        )
        for choice in training.choices
    }
    replace_parameter(command, "choices", own)
    return command


evaluator = typer.Typer(name="evaluator")
"""Commands of the evaluator beside its training, which is registered."""
app.add_typer(evaluator)


@evaluator.command("reference")
def evaluator_reference(
    bundle: Annotated[str, typer.Argument(metavar="EVALUATOR", help="Name or path of a bundle.")],
    data: Data,
    output: Output,
    overwrite: Overwrite = False,
) -> None:
    """Write a bundle's networks again with captions, embeddings and measures of these data's test clips."""
    from marey.cli.roles import training

    console.result(training.renew_reference(bundle, data, output, overwrite=overwrite))


@evaluator.command("reconstruct")
def evaluator_reconstruct(
    bundle: Annotated[str, typer.Argument(metavar="EVALUATOR", help="Name or path of the evaluator's bundle.")],
    generator: Annotated[str, typer.Argument(metavar="GENERATOR", help="A bundle, or a run's folder.")],
    data: Data,
    output: Annotated[Path | None, typer.Option("-o", "--output", help="A report, .html, .json or .md.")] = None,
    as_json: console.Json = False,
) -> None:
    """Measure a generator's tokenizer alone on real clips; reports of that generator then have the row.

    The row is kept beside the evaluator's bundle, for exactly these two bundles.
    """
    from marey.cli.roles import tokenizers

    with console.bar() as bar:
        task = bar.add_task("clips", total=None)
        found = tokenizers.reconstruct(
            bundle, generator, data, output, lambda done, total: bar.update(task, completed=done, total=total)
        )
    if as_json:
        console.result_json(found)
        return
    for source, values in found["values"].items():
        console.result(f"{source}: {found['clips'][source]} clips, {found['error_mm'][source]:.1f} mm off")
        for metric, value in values.items():
            if value["mean"] is not None:
                console.result(f"{source}/{metric} = {value['mean']:g}")


@app.command("self-train")
def self_train(
    bundle: Packed,
    data: Data,
    run: Run,
    captions: Annotated[int, typer.Option("--captions", help="Captions to draw motions for.")] = 3600,
    seed: Seed = 0,
    threads: Threads = 0,
) -> None:
    """Draw motions for training captions, and keep those that do what the caption says for the next training.

    The run must have the bundle's tokenizer: `marey train MODEL unpack` puts it there. The stage that learns from the
    kept motions finds them in the run.
    """
    from marey.cli.roles import training

    with console.bar() as bar:
        task = bar.add_task("drawing", total=None)
        kept = training.self_train(
            bundle, data, run, captions=captions, seed=seed, threads=threads,
            progress=lambda line: bar.update(task, description=line),
        )  # fmt: skip
    console.result(f"{kept} motions kept")


@app.command()
def mean(
    stage: Annotated[str, typer.Argument(metavar="STAGE", help="Such as masked.")],
    runs: Annotated[list[Path], typer.Argument(metavar="RUN…", help="Runs that have finished the stage.")],
    run: Annotated[Path, typer.Option("--run", help="The run that gets the mean; its part of the stage is replaced.")],
) -> None:
    """Take the mean of the weights of several trainings of one stage, which began from the same weights.

    It often does better than each of them. Nothing is trained.
    """
    from marey.cli.roles.training import mean_of_runs

    mean_of_runs(stage, runs, run)
    console.result(console.home_relative(run / stage))


@app.command()
def ablate(
    data: Data,
    bundle: Annotated[str, typer.Argument(metavar="BUNDLE", help="Gives the configuration and the other parts.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder of runs, numbers and tables.")],
    what: Annotated[
        str | None, typer.Option("--what", help="Which ablation of the model; none given = the only one.")
    ] = None,
    steps: Annotated[int, typer.Option("--steps", help="Optimiser steps of each variant.")] = 1500,
    batch: Annotated[int | None, typer.Option("--batch", help="Clips a step; none given = as configured.")] = None,
    seeds: Annotated[
        int,
        typer.Option(
            "--seeds", help="Training seeds of each variant; with two or more, one further where intervals touch."
        ),
    ] = 2,
    other: Annotated[
        Path | None, typer.Option("--with", help="Prepared data of which --what data adds 0, 50 and 100 %.")
    ] = None,
    evaluator: Annotated[
        str | None,
        typer.Option(
            "--evaluator",
            help="Bundle that also measures FID, Top-1 and MM-Dist of each row, by the published protocol.",
        ),
    ] = None,
    repeats: Annotated[
        int, typer.Option("--repeats", min=2, help="Generations of the test captions, for --evaluator.")
    ] = 20,
    threads: Threads = 0,
) -> None:
    """Train variants of a model, and measure what each of its parts is worth. Called again, it goes on."""
    from marey.cli.roles import training

    console.result(
        training.ablate(
            what, data, bundle, output, steps=steps, batch=batch, seeds=seeds, threads=threads, other=other,
            evaluator=evaluator, repeats=repeats,
        ).rstrip("\n")
    )  # fmt: skip
