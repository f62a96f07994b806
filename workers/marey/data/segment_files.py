"""`marey data segment`: an index of the pieces of captures, and a picture of each capture with its cuts."""

from __future__ import annotations

import csv
import io
import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from marey.core.errors import Conflict, InvalidInput
from marey.data.segment import Segmentation, SegmentRule, segment
from marey.exporters import Coordinates
from marey.exporters.convert import read_motion
from marey.motion.files import write_atomically
from marey.motion.units import Unit
from marey.viz.paper import THEMES, Paper

INDEX = "index.csv"
INDEX_FPS = 30.0
"""Frames a second at which the index counts: the default of `Dataset.index_fps`."""
COLUMNS = ("file", "start", "end", "seconds", "action", "captions")
PIXELS_A_SECOND, LEAST_WIDTH, HEIGHT, MARGIN = 12, 480, 220, 40
MAX_WIDTH = 16000
"""Pixels; a longer capture is drawn narrower."""


@dataclass(frozen=True)
class SegmentedFile:
    """A capture, and how it was cut."""

    path: Path
    found: Segmentation


def segment_files(
    paths: Sequence[Path],
    out: Path,
    rule: SegmentRule,
    *,
    unit: Unit = "cm",
    progress: Callable[[int, int], None] | None = None,
) -> list[SegmentedFile]:
    """Cut captures, and write `index.csv` and one picture for each into a folder.

    Rows of the index have the columns of `marey.data.index.Row`, with empty ones to fill in; captures shorter than the
    shortest piece have none.

    Args:
        paths: motion files.
        out: a folder that is empty or does not exist; it is created only when complete.
        unit: of BVH files, for the speed in the pictures; cuts do not depend on it.
        progress: called with the number of finished files and the total.

    Raises:
        InvalidInput: two files of one name, or an unknown format.
        Conflict: the folder is not empty.
        NotFound, InvalidFile, TooLarge: from reading.
    """
    if out.exists() and any(out.iterdir()):
        raise Conflict("the folder is not empty", where=str(out), hint="Name another one, or remove it first.")
    names = [path.stem for path in paths]
    for path in paths:
        if names.count(path.stem) > 1:
            raise InvalidInput(
                f"two files are called {path.stem}", where=str(path), hint="An index tells files by name."
            )
    work = out.with_name(out.name + ".part")
    shutil.rmtree(work, ignore_errors=True)
    work.mkdir(parents=True)
    try:
        done: list[SegmentedFile] = []
        for path in paths:
            clip = read_motion(path, Coordinates(unit=unit))
            found = segment(clip.joints, clip.skeleton, clip.fps, rule, name=path.stem)
            done.append(SegmentedFile(path, found))
            picture(found, path.name).save(work / f"{path.stem}.png")
            if progress:
                progress(len(done), len(paths))
        write_atomically(work / INDEX, index_text(done).encode())
        if out.exists():
            out.rmdir()
        work.rename(out)
    finally:
        shutil.rmtree(work, ignore_errors=True)
    return done


def index_text(files: Sequence[SegmentedFile]) -> str:
    """Return the text of the index. Its frames count at `INDEX_FPS`, the end after the last frame."""
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for file in files:
        rate = INDEX_FPS / file.found.fps
        for first, end in file.found.pieces:
            seconds = f"{(end - first) / file.found.fps:.2f}"
            writer.writerow((file.path.name, _number(first * rate), _number((end - 1) * rate + 1), seconds, "", ""))
    return text.getvalue()


def _number(value: float) -> str:
    return f"{value:.3f}".rstrip("0").rstrip(".")


def picture(found: Segmentation, title: str) -> Image.Image:
    """Draw the smoothed speed over time, its troughs (the darker, the stiller), and the cuts: blue ones were drawn,
    orange ones were made by the longest duration. Pieces have their length in seconds."""
    theme = THEMES["light"]
    seconds = len(found.speed) / found.fps
    width = int(np.clip(seconds * PIXELS_A_SECOND, LEAST_WIDTH, MAX_WIDTH))
    paper = Paper(Image.new("RGB", (width + 2 * MARGIN, HEIGHT + 2 * MARGIN), theme.paper), theme)
    draw = ImageDraw.Draw(paper.image)
    top, bottom = MARGIN, MARGIN + HEIGHT
    highest = max(float(found.speed.max(initial=0.0)), 1e-6)

    def across(frame: float) -> float:
        return MARGIN + width * frame / max(len(found.speed), 1)

    def level(speed: float) -> float:
        return bottom - (HEIGHT - 10) * speed / highest

    paper.text(
        (MARGIN, 12), f"{title}: {seconds:.1f} s, {len(found.pieces)} pieces, to {highest:.2f} m/s", 14, theme.ink
    )
    draw.line([(MARGIN, bottom), (MARGIN + width, bottom)], fill=theme.line, width=1)
    for cut in found.cuts:
        colour = theme.parts["right" if cut in found.forced else "left"]
        draw.line([(across(cut), top), (across(cut), bottom)], fill=colour, width=2)
    if len(found.speed) > 1:
        every = max(len(found.speed) // (4 * width), 1)
        points = [(across(t), level(float(found.speed[t]))) for t in range(0, len(found.speed), every)]
        draw.line(points, fill=theme.ink, width=1)
    for trough, rho in zip(found.troughs, found.rho.tolist(), strict=True):
        x, y, shade = across(trough), level(float(found.speed[trough])), round(220 * (1 - rho))
        draw.ellipse([(x - 3, y - 3), (x + 3, y + 3)], fill=(shade, shade, shade))
    for first, end in found.pieces:
        paper.text(
            (across((first + end) / 2), bottom + 8), f"{(end - first) / found.fps:.1f}", 12, theme.muted, "centre"
        )
    return paper.image
