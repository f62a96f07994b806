"""`marey edit`: operations on motion files."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from marey.cli import console, options
from marey.cli.operations import operations_of, with_operations
from marey.core.errors import InvalidInput

MOST = 2**20
"""Bytes of a file of operations."""


@with_operations
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
    ops: Annotated[
        Path | None,
        typer.Option("--ops", metavar="FILE", help='Operations as JSON, such as [{"op": "trim", "from": 0.5}].'),
    ] = None,
    file_format: Annotated[str, typer.Option("--format", help="Format of files in a folder.")] = "npz",
    bvh_root: options.BvhRoot = options.BvhRootOption.ZERO,
    root_bone: options.RootBone = False,
    tpose_frame: options.TPoseFrame = False,
    placement: options.Placement = options.PlacementOption.ORIGIN,
    mesh: options.Mesh = False,
    rig: options.Rig = None,
    rig_map: options.RigMap = None,
    names: options.JointNames = None,
    overwrite: options.Overwrite = False,
    as_json: console.Json = False,
    **operations: Any,
) -> None:
    """Edit motions: cut, join, loop, mirror, retime or smooth them. Operations apply in the order in which they are
    given."""
    from marey.cli.roles.editing import edit_files

    del operations  # `operations_of` has them in their order
    steps = operations_of(context)
    if ops is not None:
        if steps:
            raise InvalidInput("cannot be combined with operations", where="--ops", hint="Write them into the file.")
        steps = _read(ops)
    if not steps:
        raise InvalidInput("no operation is given", hint="Name one, such as --loop; `marey edit --help` lists them.")
    export = options.export_options(
        bvh_root, root_bone, None, tpose_frame, options.RestPoseOption.T, placement, mesh, rig, rig_map, names
    )
    for line in edit_files(sources, output, steps, file_format=file_format, export=export, overwrite=overwrite):
        _report(line)
        if as_json:
            console.result_json(line)
        else:
            console.result(console.home_relative(Path(line["file"])))


def _read(path: Path) -> Any:
    from marey.core.documents import parse_json
    from marey.motion.files import read_limited

    return parse_json(read_limited(path, MOST), str(path))


def _report(line: dict[str, Any]) -> None:
    faults = [] if line["quality"] is None else [flag for flag in line["quality"]["flags"] if flag != "off-prompt"]
    if faults:
        console.say(f"{line['file']}: the motion is {', '.join(faults)}.")
