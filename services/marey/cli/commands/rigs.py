"""`marey rigs …`: the skeletons of characters."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from marey.cli import console
from marey.cli.exporting import RigMap

app = typer.Typer(help="Rigs that motions are put on.", no_args_is_help=True)


COLUMNS = ("name", "version", "format", "size", "added_by", "updated", "sha256")


@app.command()
def add(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="The character: .glb, .vrm, .fbx, .usd, .bvh, .json.")],
    name: Annotated[str | None, typer.Option("--name", help="Name of the rig; the file's by default.")] = None,
    rig_map: RigMap = None,
    as_json: console.Json = False,
) -> None:
    """Add a rig to the server, for `marey motions file ID fbx --rig NAME`.

    The same file changes nothing; another file under a name is a new version.
    """
    from marey.client import Client

    with Client() as client:
        rig = client.rigs.add(file, name, rig_map=rig_map)
    if as_json:
        console.result_json(rig.raw)
        return
    console.result(rig.name)
    family, parts = rig.report.get("family"), rig.report.get("parts", {})
    console.say(f"version {rig.version}, {len(parts)} parts of the body found, family {family or 'unknown'}")
    for note in rig.report.get("notes", ()):
        console.say(f"note: {note}")


@app.command("list")
def list_rigs(as_json: console.Json = False) -> None:
    """List the rigs of the server, newest first; mixamo, ue4 and humanik are always there."""
    from marey.client import Client

    with Client() as client:
        console.listing((rig.raw for rig in client.rigs.list()), COLUMNS, _cell, as_json=as_json)


@app.command()
def remove(
    names: Annotated[list[str], typer.Argument(metavar="NAME…", help="Rigs of the server.")], yes: console.Yes = False
) -> None:
    """Remove rigs from the server, with the files that it made on them."""
    from marey.client import Client

    with Client() as client:
        found = [client.rigs.get(name) for name in dict.fromkeys(names)]
        console.confirm(f"Remove {', '.join(rig.name for rig in found)}?", yes=yes)
        for rig in found:
            client.rigs.remove(rig)
            console.say(f"removed {rig.name}")


def _cell(rig: Mapping[str, Any], column: str) -> object:
    return rig[column][:12] if column == "sha256" else rig[column]


@app.command()
def show(
    rig: Annotated[
        str, typer.Argument(metavar="NAME|FILE", help="mixamo, ue4, humanik, or a file such as .glb, .usd or .bvh.")
    ],
    rig_map: RigMap = None,
    as_json: console.Json = False,
) -> None:
    """Show which joint of a rig is which part of the body, how it was found, and what the other joints do."""
    from marey.core.extras import extra

    with extra("motion"):
        from marey.motion.retarget.load import load_body
        from marey.motion.rigs.report import describe
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
