"""`marey rigs …`: what is found in the skeleton of a character."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from marey.cli import console
from marey.cli.exporting import RigMap

if TYPE_CHECKING:
    from marey.motion.rigs.body import RigBody

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


def describe(body: RigBody) -> dict[str, Any]:
    """Return what is known of a rig, as JSON: sizes in metres."""
    rig, found = body.rig, body.map
    return {
        "name": rig.name,
        "sha256": rig.sha256,
        "family": found.family,
        "pose": "standing" if body.standing else "not standing: limbs are turned by their directions alone",
        "leg": round(body.leg, 4),
        "unit": rig.unit,
        "up": rig.up,
        "root": None if found.root is None else rig.joint_names[found.root],
        "notes": list(rig.notes),
        "parts": {
            part: {"joint": rig.joint_names[joint], "how": found.how[part]} for part, joint in found.parts.items()
        },
        "others": {
            name: _role(body, joint) for joint, name in enumerate(rig.joint_names) if joint not in found.parts.values()
        },
    }


def _role(body: RigBody, joint: int) -> str:
    """Return what becomes of a joint that is no part of the body."""
    found = body.map
    if joint in found.twists:
        twist = found.twists[joint]
        return f"twist of {twist.bone[0]}, {twist.share:.0%}"
    if joint in found.follows:
        return f"follows {found.follows[joint]}"
    if joint == found.root:
        return "root"
    return "control or end" if joint in found.controls else "keeps its rest pose"
