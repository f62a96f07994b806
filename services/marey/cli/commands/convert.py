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
    """Units of BVH files."""

    METRE = "m"
    CENTIMETRE = "cm"
    MILLIMETRE = "mm"
    INCH = "in"
    FOOT = "ft"


class Up(StrEnum):
    """Axes that may point up in BVH files."""

    Y = "y"
    Z = "z"


Source = Annotated[Path, typer.Argument(metavar="SOURCE", help="A .bvh or .npz file.")]
FromUnit = Annotated[Unit, typer.Option("--from-unit", help="Unit of a BVH source.")]
FromUp = Annotated[Up, typer.Option("--from-up", help="Axis of a BVH source that points up.")]


def convert(
    source: Source,
    target: Annotated[Path, typer.Argument(metavar="TARGET", help="A .bvh or .npz file.")],
    fps: Annotated[float | None, typer.Option("--fps", help="Frame rate of the result.")] = None,
    unit: Annotated[Unit, typer.Option("--unit", help="Unit of a BVH result.")] = Unit.CENTIMETRE,
    up: Annotated[Up, typer.Option("--up", help="Axis of a BVH result that points up.")] = Up.Y,
    from_unit: FromUnit = Unit.CENTIMETRE,
    from_up: FromUp = Up.Y,
    overwrite: options.Overwrite = False,
) -> None:
    """Convert a motion between BVH and npz, with another rate, unit or axis if wanted."""
    from marey.core.extras import needs_extra

    try:
        from marey.motion.io.convert import convert as convert_file
    except ImportError as error:
        raise needs_extra("motion", error) from error
    notes = convert_file(
        source,
        target,
        fps=fps,
        unit=unit.value,
        up=up.value,
        source_unit=from_unit.value,
        source_up=from_up.value,
        overwrite=overwrite,
    )
    for note in notes:
        console.say(f"{console.home_relative(source)}: {note}")
    console.result(console.home_relative(target))


def render(
    sources: Annotated[list[Path], typer.Argument(metavar="SOURCE…", help=".bvh or .npz files.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="A .png (contact sheet) or .html (3D player).")],
    columns: Annotated[int, typer.Option("--columns", help="Poses a motion on a contact sheet.")] = 8,
    title: Annotated[str | None, typer.Option("--title", help="A line at the top.")] = None,
    theme: Annotated[str, typer.Option("--theme", help="light or dark; a player takes auto, too.")] = "light",
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
        raise InvalidInput("is neither a .png nor a .html", where=str(output), hint="The ending says what to draw.")
    console.result(console.home_relative(output))


def _read(source: Path, unit: Unit, up: Up) -> MotionClip:
    from marey.motion.clip import load_npz
    from marey.motion.io.bvh import read_bvh
    from marey.motion.io.convert import clip_from_bvh, steady

    ending = source.suffix.lower()
    if ending == ".npz":
        return load_npz(source)
    if ending == ".bvh":
        return clip_from_bvh(steady(read_bvh(source, unit=unit.value, up=up.value)), source.name)
    raise InvalidInput("is neither a .bvh nor a .npz", where=str(source), hint="`marey convert` makes them.")
