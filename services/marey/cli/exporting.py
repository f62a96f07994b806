"""Options of the command line for exports, in the same words on every command that writes motion files."""

from __future__ import annotations

import functools
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any

import typer

from marey.cli.signatures import replace_parameter
from marey.motion import export_options
from marey.motion.export_options import ExportOptions

BvhRoot = Annotated[
    export_options.BvhRoot,
    typer.Option(
        "--bvh-root",
        help="OFFSET of the root in BVH files: zero, or offset = the pelvis height, for programs in which position "
        "channels replace it.",
    ),
]
RootBone = Annotated[
    bool,
    typer.Option("--root-bone", help="Add a bone `root` on the floor with X, Z and heading; the pelvis has the rest."),
]
InPlace = Annotated[
    export_options.InPlace | None,
    typer.Option(
        "--in-place", help="Remove the travel (X and Z), or with `heading` the turning too; default: neither."
    ),
]
TPoseFrame = Annotated[
    bool, typer.Option("--tpose-frame", help="Put the T-pose in frame 0; the motion begins in frame 1.")
]
RestPose = Annotated[
    export_options.RestPose,
    typer.Option(
        "--rest-pose", help="Rest pose of BVH, FBX and USD files: T-pose, or the A-pose of a rig whose A-pose is known."
    ),
]
Placement = Annotated[
    export_options.Placement,
    typer.Option("--placement", help="Begin at the origin, or keep the place that the motion was cut from."),
]
Mesh = Annotated[
    bool, typer.Option("--mesh", help="Add a neutral body to glb, fbx and usd files, for viewers that show no bones.")
]
RIG_HELP = (
    "Put the motion on a rig: mixamo, ue4, humanik, or a character's file (.glb, .vrm, .fbx, .usd, .bvh, .json, .npz of"
    " SMPL-X){more}; acts on BVH, glb, FBX and USD. `marey rigs show` tells what is found in it."
)
BODY_HELP = (
    "Give the motion the proportions of a character, in every format: a file as of --rig, or .npz of Marey{more};"
    " default: the body that it has."
)
SERVERS = ", or one of the server (`marey rigs list`), which then makes the files"
Rig = Annotated[str | None, typer.Option("--rig", metavar="NAME|FILE", help=RIG_HELP.format(more=""))]
FetchedRig = Annotated[str | None, typer.Option("--rig", metavar="NAME|FILE", help=RIG_HELP.format(more=SERVERS))]
RigMap = Annotated[
    Path | None,
    typer.Option(
        "--map", metavar="FILE", help="JSON of parts of the body and joint names of the rig, where they are not found."
    ),
]
JointNames = Annotated[
    export_options.Names | None,
    typer.Option(
        "--names",
        help="Rename the joints, and nothing else, for tools that retarget by name. A renamed clip put straight onto a "
        "Mixamo or Manny character collapses, for the joints of those have other axes: use --rig.",
    ),
]

Body = Annotated[str | None, typer.Option("--body", metavar="NAME|FILE", help=BODY_HELP.format(more=""))]
GeneratedBody = Annotated[
    str | None,
    typer.Option(
        "--body",
        metavar="NAME|FILE",
        help="Body that the motions are solved onto: standard, or the proportions of a character (mixamo, ue4, humanik,"
        " or a file as of --rig, or .npz of Marey); default: standard.",
    ),
]
FetchedBody = Annotated[str | None, typer.Option("--body", metavar="NAME|FILE", help=BODY_HELP.format(more=SERVERS))]

ServerRig = Annotated[
    str | None,
    typer.Option(
        "--rig",
        metavar="NAME",
        help="Put the motion on a rig: one of `marey rigs list`, or mixamo, ue4, humanik; of BVH, glb, FBX and USD.",
    ),
]
ServerBody = Annotated[
    str | None,
    typer.Option(
        "--body",
        metavar="NAME",
        help="Give the motion the proportions of a rig, in every format: one of `marey rigs list`, or mixamo, ue4,"
        " humanik; `standard` = Marey's own.",
    ),
]
OPTIONS: Mapping[str, tuple[Any, object]] = {
    "bvh_root": (BvhRoot, "zero"),
    "root_bone": (RootBone, False),
    "in_place": (InPlace, None),
    "tpose_frame": (TPoseFrame, False),
    "rest_pose": (RestPose, "t"),
    "placement": (Placement, "origin"),
    "mesh": (Mesh, False),
    "rig": (Rig, None),
    "rig_map": (RigMap, None),
    "names": (JointNames, None),
    "body": (Body, None),
}
"""Annotation and default of the option for each field of `ExportOptions`, in the order of the help."""
NO_OTHERS: Mapping[str, Any] = MappingProxyType({})


def with_export(
    *, without: Collection[str] = (), instead: Mapping[str, Any] = NO_OTHERS
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Give a command the options of exports in place of its parameter `export: ExportOptions`.

    Args:
        without: fields that the command leaves at their defaults.
        instead: other annotations of options, by field.
    """
    chosen = {
        name: (instead.get(name, annotation), default)
        for name, (annotation, default) in OPTIONS.items()
        if name not in without
    }

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        @functools.wraps(command)
        def run(*args: Any, **given: Any) -> None:
            export = ExportOptions(**{name: _plain(given.pop(name)) for name in chosen})
            command(*args, **given, export=export)

        replace_parameter(run, "export", chosen)
        return run

    return decorate


def _plain(value: object) -> Any:
    return str(value) if isinstance(value, Path) else value
