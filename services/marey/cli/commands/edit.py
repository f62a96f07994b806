"""`marey edit`: operations on motion files."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from marey.cli import console, options
from marey.cli.exporting import with_export
from marey.cli.operations import Ops, given_operations, naming_operations, with_operations
from marey.motion.export_options import PLAIN, ExportOptions


@with_operations
@with_export(without=("in_place", "rest_pose", "body"))
def edit(
    context: typer.Context,
    sources: Annotated[list[Path], typer.Argument(metavar="SOURCE…", help="Motion files, such as .npz, .bvh or .glb.")],
    output: Annotated[
        Path,
        typer.Option(
            "-o",
            "--output",
            help="A motion file, or a folder for the motions of several sources. Pieces of a split are numbered: "
            "walk-1.npz, walk-2.npz.",
        ),
    ],
    ops: Ops = None,
    file_format: Annotated[str, typer.Option("--format", help="Format of files in a folder.")] = "npz",
    model: options.Model = None,
    bundle: options.BundleOrFolder = None,
    sampling: options.Sampling = None,
    scope: options.Scope = "warn",
    export: ExportOptions = PLAIN,
    overwrite: options.Overwrite = False,
    as_json: console.Json = False,
    **operations: Any,
) -> None:
    """Edit motions: cut, join, loop, mirror, retime or smooth them, or let a model generate frames of them. Operations
    apply in the order in which they are given."""
    from marey.cli.roles.editing import edit_files, model_for

    del operations  # `given_operations` has them in their order
    steps = given_operations(context, ops)
    settings = options.settings_of(sampling or ())
    with naming_operations(context, ops):
        editor, warnings = model_for(steps, bundle or model, settings, scope)
        console.warn_all(warnings)
        made = edit_files(
            sources, output, steps, model=editor, file_format=file_format, export=export, overwrite=overwrite
        )
        for line in made:
            _report(line)
            if as_json:
                console.result_json(line)
            else:
                console.result(console.home_relative(Path(line["file"])))


def _report(line: dict[str, Any]) -> None:
    faults = [] if line["quality"] is None else [flag for flag in line["quality"]["flags"] if flag != "off-prompt"]
    if faults:
        console.say(f"{console.home_relative(Path(line['file']))}: the motion has the flags {', '.join(faults)}.")
