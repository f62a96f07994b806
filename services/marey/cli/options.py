"""Options that several commands share."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

import typer

from marey.client.names import DEFAULT_TEMPLATE
from marey.client.rows import Format
from marey.client.tables import ExtraColumns
from marey.core.errors import InvalidInput, PluginError
from marey.items.settings import MAX_BEST_OF, MAX_REDRAWS, OUTPUT_FPS, PLATFORM_SETTINGS, read_setting


def settings_of(given: Sequence[str]) -> dict[str, float]:
    """Read the settings of `--set NAME=VALUE`.

    Raises:
        InvalidInput: one is something else.
    """
    try:
        return dict(map(read_setting, given))
    except InvalidInput as error:
        hint = None if error.where is None else _allowed(error.where)
        raise InvalidInput(error.message, where="--set", hint=hint) from None


def _allowed(setting: str) -> str:
    """Return a hint with the values that a setting may have, as far as they are known here."""
    from marey.registry import models_by_range

    if setting in PLATFORM_SETTINGS:
        low, high = PLATFORM_SETTINGS[setting]
        return f"Allowed: {'' if setting == OUTPUT_FPS else 'whole numbers, '}{low:g} to {high:g}."
    try:
        found = models_by_range(setting)
    except PluginError:
        found = {}
    ranges = "; ".join(f"{values} with {', '.join(names)}" for values, names in found.items())
    return f"Allowed: {ranges}." if ranges else "`marey models show NAME` lists the settings of a model."


Prompts = Annotated[list[str] | None, typer.Argument(metavar="PROMPT…", help="The motion in words.")]
PromptFile = Annotated[
    str | None,
    typer.Option(
        "-f", "--file", help="CSV, JSONL or text file of prompts, also as .gz; - is stdin.", show_default=False
    ),
]
Timelines = Annotated[
    list[str] | None,
    typer.Option(
        "--timeline",
        metavar="ROWS",
        help='Prompts at stated times, in one motion of up to 60 s: "0-3 a person walks; 3-5 a person waves". May be '
        "repeated.",
    ),
]
PromptFormat = Annotated[Format | None, typer.Option("--input-format", help="Format of -f; default: by its extension.")]
Extra = Annotated[
    ExtraColumns,
    typer.Option("--extra-columns", help="Unknown CSV columns: an error, a tag column=value of the row, or ignored."),
]
Formats = Annotated[
    list[str] | None,
    typer.Option(
        "--format",
        metavar="FORMAT",
        help="File format, such as bvh, fbx, glb or mp4; may be repeated. None given = npz and bvh.",
    ),
]
Folder = Annotated[Path, typer.Option("-o", "--output", help="Folder to write to; created if missing.")]
Template = Annotated[
    str,
    typer.Option(
        "--name-template",
        help="File names, of {index} {name} {prompt} {seed} {variant} {model} {bundle} {job} {tags}, and {tag:shot} "
        "for shot=…; index and variant count from 0, / makes folders.",
    ),
]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace existing files with other content.")]
Seconds = Annotated[
    float | None,
    typer.Option("--seconds", help="Length in seconds; default: as the prompt states, else the model's estimate."),
]
Seed = Annotated[int | None, typer.Option("--seed", help="Seed of the first variant; default: random.")]
Variants = Annotated[int | None, typer.Option("--variants", help="Motions per prompt; a row's own value overrides it.")]
Tags = Annotated[
    list[str] | None, typer.Option("--tag", help="A tag of every motion, in addition to a row's own; may be repeated.")
]
Fps = Annotated[float | None, typer.Option("--fps", help="Frame rate of the files; default: the model's.")]
BestOf = Annotated[
    int | None,
    typer.Option(
        "--best-of", help=f"Candidates of each motion, of which the best is kept: 1 to {MAX_BEST_OF}; default 1."
    ),
]
Redraws = Annotated[
    int | None,
    typer.Option("--redraws", help=f"Further rounds of candidates while none is good. 0 to {MAX_REDRAWS}, default 0."),
]
Variety = Annotated[
    Literal["low", "normal", "high"] | None,
    typer.Option("--variety", help="How much motions of one prompt differ; default: normal, as the bundle ships."),
]
Sampling = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="NAME=VALUE",
        help="A setting of sampling, such as temperature=1.2; may be repeated. `marey models show` lists them; a row's "
        "own come first.",
    ),
]
Scope = Annotated[
    Literal["warn", "refuse", "ignore"],
    typer.Option("--scope", help="Prompts that the model does not know: a warning, an error, or not examined."),
]
Model = Annotated[str | None, typer.Option("--model", help="Model, such as hgm3.")]
Bundle = Annotated[str | None, typer.Option("--bundle", help="Bundle, such as hgm3-starter.")]
BundleOrFolder = Annotated[str | None, typer.Option("--bundle", help="Bundle, such as hgm3-starter, or its folder.")]
Loop = Annotated[
    bool,
    typer.Option("--loop", help="Cut a cycle out of each motion that can be played on, as `marey edit --loop`."),
]
Constraints = Annotated[
    Path | None,
    typer.Option(
        "--constraints",
        metavar="FILE.json",
        help="Paths of the root, poses and targets of hands, feet and head that every motion meets.",
    ),
]
TEMPLATE = DEFAULT_TEMPLATE
