"""`marey convert` and `marey render`: motion files in, motion files and pictures out."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from marey.cli import console, options
from marey.cli.exporting import with_export
from marey.core.errors import InvalidInput
from marey.motion.export_options import PLAIN, ExportOptions, RestPose
from marey.motion.units import Unit, Up

if TYPE_CHECKING:
    from marey.motion.clip import MotionClip

Source = Annotated[Path, typer.Argument(metavar="SOURCE", help="A motion file, such as .bvh or .npz.")]
FromUnit = Annotated[Unit, typer.Option("--from-unit", help="Unit of a BVH source.")]
FromUp = Annotated[Up, typer.Option("--from-up", help="Axis of a BVH source that points up.")]


@with_export()
def convert(
    source: Source,
    target: Annotated[
        Path, typer.Argument(metavar="TARGET", help="A motion file or a film, such as .bvh, .fbx or .mp4.")
    ],
    fps: Annotated[float | None, typer.Option("--fps", help="Frame rate of the result; default: unchanged.")] = None,
    unit: Annotated[Unit, typer.Option("--unit", help="Unit of a BVH, FBX or USD result.")] = "cm",
    up: Annotated[Up, typer.Option("--up", help="Axis of a BVH, FBX or USD result that points up.")] = "y",
    export: ExportOptions = PLAIN,
    from_unit: FromUnit = "cm",
    from_up: FromUp = "y",
    from_rest_pose: Annotated[
        RestPose,
        typer.Option("--from-rest-pose", help="Rest pose of a BVH source whose A-pose is known."),
    ] = "t",
    overwrite: options.Overwrite = False,
) -> None:
    """Convert a motion between BVH, FBX, glb, npz and other formats, with another rate, unit, axis, root or pose."""
    from marey.core.extras import extra

    with extra("motion"):
        from marey.exporters.convert import convert as convert_file
    notes = convert_file(
        source,
        target,
        fps=fps,
        unit=unit,
        up=up,
        export=export,
        source_unit=from_unit,
        source_up=from_up,
        source_rest_pose=from_rest_pose,
        overwrite=overwrite,
    )
    for note in notes:
        console.say(f"{console.home_relative(source)}: {note}")
    console.result(console.home_relative(target))


def render(
    sources: Annotated[
        list[Path],
        typer.Argument(metavar="SOURCE…", help="Motion files, such as .bvh or .npz, or prepared folders with --clip."),
    ],
    output: Annotated[Path, typer.Option("-o", "--output", help="A .png (contact sheet) or .html (3D player).")],
    columns: Annotated[int, typer.Option("--columns", help="Poses per motion on a contact sheet.")] = 8,
    title: Annotated[str | None, typer.Option("--title", help="A line at the top.")] = None,
    theme: Annotated[str, typer.Option("--theme", help="light or dark; auto is possible for a player.")] = "light",
    clip: Annotated[
        list[int] | None,
        typer.Option("--clip", help="Number of a clip, from 0 on, of each prepared folder; repeatable."),
    ] = None,
    difficulty: Annotated[
        str | None,
        typer.Option(
            "--difficulty",
            metavar="BUNDLE",
            help="Show how hard each token of a motion is for this bundle's model, over time.",
        ),
    ] = None,
    from_unit: FromUnit = "cm",
    from_up: FromUp = "y",
) -> None:
    """Draw motions: a contact sheet as PNG, or a page with a 3D player; with --difficulty both show a heat map."""
    from marey.core.extras import extra

    with extra("motion"):
        from marey.viz.player import html_player
        from marey.viz.render import contact_sheet
    named = [each for source in sources for each in _read_all(source, clip or [], from_unit, from_up)]
    names, clips = [name for name, _ in named], [motion for _, motion in named]
    captions = [str(motion.manifest.get("prompt") or Path(name).stem) for name, motion in named]
    ending = output.suffix.lower()
    if difficulty is not None and ending in (".png", ".html", ".htm"):
        from marey.cli.roles.drawing import difficulties_of
        from marey.viz.difficulty import draw_difficulty

        found = difficulties_of(difficulty, clips, names)
        draw_difficulty(clips, found, output, captions=captions, columns=columns, title=title, theme=theme)
    elif ending == ".png":
        contact_sheet(clips, output, columns=columns, title=title, captions=captions, theme=theme)
    elif ending in (".html", ".htm"):
        html_player(clips, output, title=title, captions=captions, theme=theme)
    else:
        raise InvalidInput("is neither a .png nor a .html", where=str(output), hint="Use the extension .png or .html.")
    console.result(console.home_relative(output))


def _read_all(source: Path, numbers: list[int], unit: Unit, up: Up) -> list[tuple[str, MotionClip]]:
    """Read the motion of a file, or clips of a prepared folder by number; each with its name."""
    if not source.is_dir():
        return [(str(source), _read(source, unit, up))]
    if not numbers:
        raise InvalidInput("is a folder", where=str(source), hint="Name clips of a prepared folder by --clip NUMBER.")
    from marey.cli.roles.drawing import prepared_clip

    return [(f"{source}: clip {number}", prepared_clip(source, number)) for number in numbers]


def _read(source: Path, unit: Unit, up: Up) -> MotionClip:
    from marey.exporters import Coordinates
    from marey.exporters.convert import read_motion

    return read_motion(source, Coordinates(unit, up))
