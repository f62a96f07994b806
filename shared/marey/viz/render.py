"""Contact sheet: clips as rows of poses on one image.

A clip is a row: a strip of poses over time with the tracks of foot contact under it (`strip.py`), and beside it the
path seen from above. An overview shows many clips on one sheet (`overview.py`).
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from marey.core.errors import InvalidInput
from marey.motion.clip import MotionClip
from marey.motion.files import write_atomically
from marey.motion.kinematics import facing
from marey.viz.body import Part, forward_of
from marey.viz.paper import Paper, Theme, theme_named
from marey.viz.strip import Strip, chosen_frames, draw_lanes, draw_pose, make_strip, view_points

CELL = (196, 268)  # pixels a pose
PLAN = 232
MARGIN, GAP, LANE = 44, 34, 6
MOST_COLUMNS = 24
COLUMNS = 8
PLAN_SMOOTH = 3
LEGEND: tuple[tuple[Part, str], ...] = (("left", "left"), ("right", "right"))


def contact_sheet(
    clips: MotionClip | Sequence[MotionClip],
    path: str | Path,
    *,
    columns: int = COLUMNS,
    frames: Sequence[int] | None = None,
    title: str | None = None,
    captions: Sequence[str] | None = None,
    theme: str = "light",
) -> Path:
    """Draw clips as strips of poses into a PNG.

    Args:
        clips: one clip, or several, which become rows.
        path: the PNG to write.
        columns: poses per clip, evenly spaced from its first frame to its last.
        frames: these frames instead.
        title: a line at the top of the sheet.
        captions: one per clip; otherwise the prompt of its manifest.
        theme: `light` or `dark`.

    Returns:
        The path written.

    Raises:
        InvalidInput: nothing to draw, a frame that is not in the clip, an unknown theme, or a path that is not a
            writable PNG.
    """
    rows = [clips] if isinstance(clips, MotionClip) else list(clips)
    path = Path(path)
    if not rows:
        raise InvalidInput("no clip to draw", hint="Give at least one.")
    if not 1 <= columns <= MOST_COLUMNS:
        raise InvalidInput(f"{columns} columns; a sheet takes 1 to {MOST_COLUMNS}")
    if captions is not None and len(captions) != len(rows):
        raise InvalidInput(f"{len(captions)} captions for {len(rows)} clips")
    check_png(path)
    paper = theme_named(theme)
    chosen = [chosen_frames(clip, columns, frames) for clip in rows]
    widest = max(map(len, chosen))
    images = [
        draw_row(clip, captions[row] if captions else caption_of(clip), frames, columns=widest, theme=paper)
        for row, (clip, frames) in enumerate(zip(rows, chosen, strict=True))
    ]
    return save_png(stack_rows(images, title, theme=paper), path)


def check_png(path: Path) -> None:
    """Validate that the name ends in `.png`.

    Raises:
        InvalidInput: it is not.
    """
    if path.suffix.lower() != ".png":
        raise InvalidInput(f"a contact sheet is a .png, not {path.suffix or 'a name without ending'}", where=str(path))


def save_png(image: Image.Image, path: Path) -> Path:
    """Write a picture atomically."""
    buffer = io.BytesIO()
    image.save(buffer, format="PNG", compress_level=5)
    write_atomically(path, buffer.getvalue())
    return path


def stack_rows(rows: Sequence[Image.Image], title: str | None, *, theme: Theme) -> Image.Image:
    """Return a sheet of rows, from `draw_row`, all of one width."""
    width, head = rows[0].width + 2 * MARGIN, 64 if title else 0
    height = MARGIN - 8 + head + sum(row.height for row in rows) + GAP * (len(rows) - 1) + 46
    paper = Paper(Image.new("RGB", (width, height), theme.paper), theme)
    y = MARGIN - 8
    if title:
        paper.text((MARGIN, y), paper.wrap(title, 30, width - 2 * MARGIN, lines=1)[0], 30, theme.ink)
        y += head
    for row in rows:
        paper.image.paste(row, (MARGIN, y))
        y += row.height + GAP
    draw_legend(paper)
    return paper.image


def caption_of(clip: MotionClip) -> str:
    """Return the prompt of a clip; empty if its manifest has none."""
    return str(clip.manifest.get("prompt") or "")


def facts_of(clip: MotionClip) -> str:
    """Describe a clip in one line: length, rate, seed, model, terms, and a note if the weights are random."""
    facts = [f"{clip.seconds:.1f} s", f"{clip.frames} frames at {clip.fps:g} fps"]
    if clip.manifest.get("seed") is not None:
        facts.append(f"seed {clip.manifest['seed']}")
    facts += [str(clip.manifest[key]) for key in ("bundle", "licence") if clip.manifest.get(key)]
    if clip.manifest.get("random_weights"):
        facts.append("RANDOM WEIGHTS")
    return "  ·  ".join(facts)


def draw_row(clip: MotionClip, caption: str, frames: NDArray[np.intp], *, columns: int, theme: Theme) -> Image.Image:
    """Draw one clip: caption and facts, the poses of these frames, the foot-contact tracks, and the path from above.

    Args:
        columns: number of poses that fit in the row.
    """
    strip = make_strip(clip, frames, CELL)
    width, facts = columns * CELL[0] + 24 + PLAN, facts_of(clip)
    probe = Paper(Image.new("RGB", (1, 1)), theme)
    lines = probe.wrap(caption, 21, width - 40 - probe.length(facts, 14), lines=2)
    top = 27 * max(len(lines), 1) + 14
    paper = Paper(Image.new("RGB", (width, top + CELL[1] + 24 + 2 * (LANE + 5)), theme.paper), theme)
    for line, text in enumerate(lines):
        paper.text((0, 27 * line), text, 21, theme.ink)
    paper.text((width, 5), facts, 14, theme.muted, align="right")
    for column, frame in enumerate(frames):
        left = column * CELL[0]
        paper.image.paste(draw_pose(strip, column, theme), (left, top))
        at = (left + CELL[0] / 2, top + CELL[1] + 2)
        paper.text(at, f"{frame / clip.fps:.2f} s", 14, theme.muted, align="centre")
    draw_lanes(paper, strip, (0, top + CELL[1] + 26), LANE)
    paper.image.paste(_plan(strip, theme), (width - PLAN, top))
    return paper.image


def _plan(strip: Strip, theme: Theme) -> Image.Image:
    """Draw the path from above, up is where the figure faced first (+Z), with an arrow where each pose faces."""
    big = PLAN_SMOOTH
    size = (PLAN * big, CELL[1] * big)
    image = Image.new("RGB", size, theme.paper)
    draw = ImageDraw.Draw(image)
    draw.rounded_rectangle([0, 0, size[0] - 1, size[1] - 1], radius=12 * big, fill=theme.floor)
    path = strip.root[:, [0, 2]]
    middle = (path.min(axis=0) + path.max(axis=0)) / 2
    spread = np.maximum(np.ptp(path, axis=0) + 0.9, 2.0)
    scale = min(size[0] / spread[0], (size[1] - 40 * big) / spread[1])
    step = next(s for s in (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 1e9) if s * scale > 28 * big)

    def pixels(points: NDArray[np.floating]) -> NDArray[np.floating]:
        # Seen from above with +Z up the page, +X (the figure's left in frame 0) is on the left.
        return np.array([size[0] / 2, (size[1] - 20 * big) / 2]) - (points - middle) * scale

    _plan_grid(draw, middle, step, scale, size, theme)
    draw.line(view_points(pixels(path)), fill=theme.muted, width=2 * big, joint="curve")
    ahead = _headings(strip)
    for frame, heading in zip(strip.frames, ahead, strict=True):
        at = pixels(path[frame])
        tip = at - heading * 13 * big
        side = np.array([-heading[1], heading[0]]) * 5 * big
        draw.polygon(view_points(np.stack([tip, at + side, at - side])), fill=theme.ink)
    first = pixels(path[0])
    r = 4.5 * big
    draw.ellipse([*(first - r), *(first + r)], fill=theme.paper, outline=theme.ink, width=big)
    small = Paper(image.resize((PLAN, CELL[1]), Image.Resampling.LANCZOS), theme)
    small.text((PLAN / 2, CELL[1] - 20), f"from above  ·  grid {step:g} m", 12, theme.muted, align="centre")
    return small.image


def _plan_grid(
    draw: ImageDraw.ImageDraw,
    middle: NDArray[np.floating],
    step: float,
    scale: float,
    size: tuple[int, int],
    theme: Theme,
) -> None:
    bottom = size[1] - 24 * PLAN_SMOOTH
    centre = (size[0] / 2, (size[1] - 20 * PLAN_SMOOTH) / 2)
    inset = 4 * PLAN_SMOOTH
    for axis, (low, high) in enumerate(((inset, size[0] - inset), (inset, bottom))):
        reach = size[axis] / scale
        for line in range(int((middle[axis] - reach) // step), int((middle[axis] + reach) // step) + 2):
            pixel = float(centre[axis] - (line * step - middle[axis]) * scale)
            if low < pixel < high:
                ends = [(pixel, inset), (pixel, bottom)] if axis == 0 else [(inset, pixel), (size[0] - inset, pixel)]
                draw.line(ends, fill=theme.line, width=PLAN_SMOOTH)


def _headings(strip: Strip) -> NDArray[np.floating]:
    """Return X and Z (F, 2) of the direction that each chosen pose faces."""
    clip = strip.clip
    if clip.skeleton.facing:
        return facing(np.asarray(clip.joints[strip.frames], np.float64), clip.skeleton)[:, [0, 2]]
    return forward_of(clip.skeleton, clip.joints[strip.frames])[:, [0, 2]]


def draw_legend(paper: Paper) -> None:
    """Draw the legend of the colours at the foot of a sheet."""
    width, height = paper.image.size
    y = height - 34
    x: float = MARGIN
    theme = paper.theme
    draw = ImageDraw.Draw(paper.image)
    for part, label in LEGEND:
        draw.ellipse([x, y + 3, x + 10, y + 13], fill=theme.parts[part])
        paper.text((x + 16, y), label, 13, theme.muted)
        x += 16 + paper.length(label, 13) + 22
    paper.text((x, y), "lit floor and bars: foot on the floor (pale bar: heel or toe alone)", 13, theme.muted)
    paper.text((width - MARGIN, y), "Marey", 13, theme.muted, align="right")
