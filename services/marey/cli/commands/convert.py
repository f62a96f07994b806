"""`marey convert` and `marey render`: motion files in, motion files and pictures out."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from marey.cli import console, options
from marey.core.errors import InvalidInput

if TYPE_CHECKING:
    from marey.motion.clip import MotionClip


class Unit(StrEnum):
    """Units of files, such as BVH, that do not name theirs."""

    METRE = "m"
    CENTIMETRE = "cm"
    MILLIMETRE = "mm"
    INCH = "in"
    FOOT = "ft"


class Up(StrEnum):
    """Axes that may point up in files that do not name it."""

    Y = "y"
    Z = "z"


Source = Annotated[Path, typer.Argument(metavar="SOURCE", help="A motion file, such as .bvh or .npz.")]
FromUnit = Annotated[Unit, typer.Option("--from-unit", help="Unit of a BVH source.")]
FromUp = Annotated[Up, typer.Option("--from-up", help="Axis of a BVH source that points up.")]


def convert(
    source: Source,
    target: Annotated[
        Path, typer.Argument(metavar="TARGET", help="A motion file or a film, such as .bvh, .glb or .mp4.")
    ],
    fps: Annotated[float | None, typer.Option("--fps", help="Frame rate of the result; default: unchanged.")] = None,
    unit: Annotated[Unit, typer.Option("--unit", help="Unit of a BVH result.")] = Unit.CENTIMETRE,
    up: Annotated[Up, typer.Option("--up", help="Axis of a BVH result that points up.")] = Up.Y,
    bvh_root: options.BvhRoot = options.BvhRootOption.ZERO,
    root_bone: options.RootBone = False,
    in_place: options.InPlace = None,
    tpose_frame: options.TPoseFrame = False,
    rest_pose: options.RestPose = options.RestPoseOption.T,
    placement: options.Placement = options.PlacementOption.ORIGIN,
    mesh: options.Mesh = False,
    from_unit: FromUnit = Unit.CENTIMETRE,
    from_up: FromUp = Up.Y,
    from_rest_pose: Annotated[
        options.RestPoseOption,
        typer.Option("--from-rest-pose", help="Rest pose of a BVH source whose A-pose is known."),
    ] = options.RestPoseOption.T,
    overwrite: options.Overwrite = False,
) -> None:
    """Convert a motion between BVH, glb, npz and installed formats, with another rate, unit, axis, root or pose."""
    from marey.core.extras import needs_extra

    try:
        from marey.exporters.convert import convert as convert_file
    except ImportError as error:
        raise needs_extra("motion", error) from error
    notes = convert_file(
        source,
        target,
        fps=fps,
        unit=unit.value,
        up=up.value,
        export=options.export_options(bvh_root, root_bone, in_place, tpose_frame, rest_pose, placement, mesh),
        source_unit=from_unit.value,
        source_up=from_up.value,
        source_rest_pose=from_rest_pose.value,
        overwrite=overwrite,
    )
    for note in notes:
        console.say(f"{console.home_relative(source)}: {note}")
    console.result(console.home_relative(target))


def render(
    sources: Annotated[list[Path], typer.Argument(metavar="SOURCE…", help="Motion files, such as .bvh or .npz.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="A .png (contact sheet) or .html (3D player).")],
    columns: Annotated[int, typer.Option("--columns", help="Poses per motion on a contact sheet.")] = 8,
    title: Annotated[str | None, typer.Option("--title", help="A line at the top.")] = None,
    theme: Annotated[str, typer.Option("--theme", help="light or dark; auto is possible for a player.")] = "light",
    from_unit: FromUnit = Unit.CENTIMETRE,
    from_up: FromUp = Up.Y,
) -> None:
    """Draw motions: a contact sheet as PNG, or a page with a 3D player."""
    from marey.core.extras import needs_extra

    try:
        from marey.viz.player import html_player
        from marey.viz.render import contact_sheet
    except ImportError as error:
        raise needs_extra("motion", error) from error
    clips = [_read(source, from_unit, from_up) for source in sources]
    captions = [str(clip.manifest.get("prompt") or source.stem) for clip, source in zip(clips, sources, strict=True)]
    ending = output.suffix.lower()
    if ending == ".png":
        contact_sheet(clips, output, columns=columns, title=title, captions=captions, theme=theme)
    elif ending in (".html", ".htm"):
        html_player(clips, output, title=title, captions=captions, theme=theme)
    else:
        raise InvalidInput("is neither a .png nor a .html", where=str(output), hint="Use the extension .png or .html.")
    console.result(console.home_relative(output))


def _read(source: Path, unit: Unit, up: Up) -> MotionClip:
    from marey.exporters import Coordinates
    from marey.exporters.convert import read_motion

    return read_motion(source, Coordinates(unit.value, up.value))
