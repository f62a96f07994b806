"""`marey train MODEL …`."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from marey.cli import console

app = typer.Typer(help="Train a model, stage by stage, then write its bundle.", no_args_is_help=True)
hgm3 = typer.Typer(help="HGM³: stages in this order, then `bundle`.", no_args_is_help=True)
app.add_typer(hgm3, name="hgm3")
mogo = typer.Typer(help="MOGO: tokenizer, transformer, then `bundle`.", no_args_is_help=True)
app.add_typer(mogo, name="mogo")
evaluator = typer.Typer(help="What judges generated motions: the stage `tmr`, then `bundle`.", no_args_is_help=True)
app.add_typer(evaluator, name="evaluator")

Model = Literal["hgm3", "mogo", "evaluator"]


class Mask(StrEnum):
    """What the masked transformer masks in training."""

    HARD = "hard"
    RANDOM = "random"


Data = Annotated[Path, typer.Argument(metavar="DATA", help="A prepared folder, with its texts.")]
Run = Annotated[Path, typer.Option("--run", help="Folder of all stages of one bundle.")]
Config = Annotated[str, typer.Option("--config", help="starter, paper or tiny.")]
Steps = Annotated[int | None, typer.Option("--steps", help="Optimiser steps.")]
Minutes = Annotated[float | None, typer.Option("--max-minutes", help="Minutes; schedules follow whichever ends first.")]
Seed = Annotated[int, typer.Option("--seed", help="Of weights and batches.")]
Resume = Annotated[bool, typer.Option("--resume", help="Go on from the last checkpoint.")]
Warm = Annotated[bool, typer.Option("--warm", help="Start from the stage's finished part, not from nothing.")]
Masking = Annotated[Mask | None, typer.Option("--mask", help="hard or random; none given = as the configuration says.")]
Device = Annotated[str, typer.Option("--device", help="auto, cpu, cuda, cuda:1 …")]
Threads = Annotated[int, typer.Option("--threads", help="0 = torch's own choice.")]
Rate = Annotated[float | None, typer.Option("--learning-rate", help="None given = as the configuration says.")]
Bf16 = Annotated[bool, typer.Option("--bf16/--no-bf16", help="Matrices in bfloat16 where that pays.")]


def _run(model: Model, stage: str, as_json: bool, **chosen: Any) -> None:
    from marey.cli.roles import training

    metrics = training.train_stage(model, stage, **chosen)
    if as_json:
        console.result_json(metrics)
    else:
        for metric, value in metrics.items():
            console.result(f"{metric} = {value:g}")


def _hgm3_stage(name: str, what: str) -> None:
    """Add the command of one stage."""

    def command(
        data: Data,
        run: Run,
        config: Config = "starter",
        steps: Steps = None,
        max_minutes: Minutes = None,
        seed: Seed = 0,
        resume: Resume = False,
        warm: Warm = False,
        learning_rate: Rate = None,
        mask: Masking = None,
        device: Device = "auto",
        threads: Threads = 0,
        bf16: Bf16 = True,
        as_json: console.Json = False,
    ) -> None:
        _run(
            "hgm3", name, as_json, data=data, run=run, config=config, steps=steps, minutes=max_minutes, seed=seed,
            resume=resume, warm=warm, rate=learning_rate, device=device, threads=threads, bf16=bf16,
            mask=None if mask is None else mask.value,
        )  # fmt: skip

    hgm3.command(name, help=what)(command)


def _stage(model: Literal["mogo", "evaluator"], name: str, what: str) -> None:
    """Add the command of one stage that has no options of its own."""

    def command(
        data: Data,
        run: Run,
        config: Config = "starter",
        steps: Steps = None,
        max_minutes: Minutes = None,
        seed: Seed = 0,
        resume: Resume = False,
        warm: Warm = False,
        learning_rate: Rate = None,
        device: Device = "auto",
        threads: Threads = 0,
        bf16: Bf16 = True,
        as_json: console.Json = False,
    ) -> None:
        _run(
            model, name, as_json, data=data, run=run, config=config, steps=steps, minutes=max_minutes, seed=seed,
            resume=resume, warm=warm, rate=learning_rate, device=device, threads=threads, bf16=bf16,
        )  # fmt: skip

    {"mogo": mogo, "evaluator": evaluator}[model].command(name, help=what)(command)


_hgm3_stage("tokenizer", "Train the residual VQ-VAE.")
_hgm3_stage("masked", "Train the masked transformer, with hard token mining.")
_hgm3_stage("residual", "Train the residual transformer.")
_hgm3_stage("length", "Train the length estimator.")
_hgm3_stage("all", "All stages one after another, --max-minutes for them together; called again, it goes on.")
_stage("mogo", "tokenizer", "Train the MoSA-VQ.")
_stage("mogo", "transformer", "Train the RQHC-Transformer.")
_stage("mogo", "all", "Both stages one after another, --max-minutes for them together; called again, it goes on.")
_stage("evaluator", "tmr", "Train the motion and the text encoder of the evaluator.")


Output = Annotated[Path, typer.Option("-o", "--output", help="The bundle's folder, such as models/hgm3-starter.")]
Card = Annotated[Path | None, typer.Option("--card", help="The model card to put in.")]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace a bundle that is there.")]


@hgm3.command("bundle")
def hgm3_bundle(
    data: Data,
    run: Run,
    output: Output,
    config: Config = "starter",
    mask: Masking = None,
    card: Card = None,
    overwrite: Overwrite = False,
) -> None:
    """Write the bundle from the parts of a run."""
    from marey.cli.roles import training

    chosen = None if mask is None else mask.value
    made = training.assemble_bundle(
        "hgm3", data, run, output, config=config, card=card, overwrite=overwrite, mask=chosen
    )
    console.result(made)


@mogo.command("bundle")
def mogo_bundle(
    data: Data, run: Run, output: Output, config: Config = "starter", card: Card = None, overwrite: Overwrite = False
) -> None:
    """Write the bundle from the parts of a run."""
    from marey.cli.roles import training

    console.result(training.assemble_bundle("mogo", data, run, output, config=config, card=card, overwrite=overwrite))


@evaluator.command("bundle")
def evaluator_bundle(
    data: Data, run: Run, output: Output, config: Config = "starter", card: Card = None, overwrite: Overwrite = False
) -> None:
    """Write the bundle from the part of a run, with captions and embeddings of the real test clips."""
    from marey.cli.roles import training

    console.result(
        training.assemble_bundle("evaluator", data, run, output, config=config, card=card, overwrite=overwrite)
    )


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
    bundle: Annotated[str, typer.Argument(metavar="EVALUATOR", help="Name or path of the bundle that measures.")],
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


Packed = Annotated[str, typer.Argument(metavar="BUNDLE", help="Name or path of a bundle.")]
UNPACK = "Write the parts of a bundle into a run, to train on from them with `--warm`, on the same data or your own."


@hgm3.command("unpack", help=UNPACK)
def hgm3_unpack(bundle: Packed, run: Run) -> None:
    from marey.cli.roles import training

    console.result(training.take_bundle_apart("hgm3", bundle, run))


@mogo.command("unpack", help=UNPACK)
def mogo_unpack(bundle: Packed, run: Run) -> None:
    from marey.cli.roles import training

    console.result(training.take_bundle_apart("mogo", bundle, run))
