"""`marey rigs …`: what is found in the skeleton of a character."""

from __future__ import annotations

from typing import Annotated

import typer

from marey.cli import console
from marey.cli.exporting import RigMap

app = typer.Typer(help="Rigs that motions are put on.", no_args_is_help=True)


@app.callback()
def main() -> None:
    """Keep `show` a command of its own while it is the only one."""


@app.command()
def show(
    rig: Annotated[
        str, typer.Argument(metavar="NAME|FILE", help="mixamo, ue4, humanik, or a file such as .glb, .bvh or .json.")
    ],
    rig_map: RigMap = None,
    as_json: console.Json = False,
) -> None:
    """Show which joint of a rig is which part of the body, how it was found, and what the other joints do."""
    from marey.core.extras import needs_extra

    try:
        from marey.motion.retarget.load import load_body
        from marey.motion.rigs.report import describe
    except ImportError as error:
        raise needs_extra("motion", error) from error
    body = load_body(rig, rig_map)
    about = describe(body)
    if as_json:
        console.result_json(about)
        return
    for field in ("name", "sha256", "family", "pose", "leg", "unit", "up", "root"):
        console.result(f"{field:<8} {about[field] if about[field] is not None else '-'}")
    for note in about["notes"]:
        console.result(f"{'note':<8} {note}")
    rows = [(part, found["joint"], found["how"]) for part, found in about["parts"].items()]
    rows += [(role, joint, "") for joint, role in about["others"].items()]
    console.table(("part", "joint", "found by"), rows)
