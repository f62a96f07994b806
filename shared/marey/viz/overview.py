"""Overview: many motions on one sheet, as tiles of small poses in several columns.

A tile has a fixed size, so a sheet can be filled while its tiles arrive from the processes that draw them.
"""

from __future__ import annotations

from collections.abc import Iterable
from math import ceil, sqrt

from PIL import Image

from marey.core.errors import InvalidInput
from marey.motion.clip import MotionClip
from marey.viz.paper import Paper, Theme
from marey.viz.render import MARGIN, draw_legend, facts_of
from marey.viz.strip import chosen_frames, draw_lanes, draw_pose, make_strip

CELL = (112, 153)  # pixels a pose
POSES = 6
LANE = 4
TEXT = 42  # pixels for prompt and facts
TILE = (POSES * CELL[0], TEXT + CELL[1] + 16 + 2 * (LANE + 5))
GAP = (32, 12)  # between tiles: across, down
ACROSS = 6
"""Largest number of tiles side by side: a wider sheet has to be scrolled both ways."""
MOST_TILES = 400
"""Largest number of tiles: such a sheet is 16,000 pixels high, and viewers and graphics cards refuse pictures beyond
16,384."""


def draw_tile(clip: MotionClip, caption: str, *, theme: Theme) -> Image.Image:
    """Draw one clip: caption, facts, six poses and the foot-contact tracks."""
    strip = make_strip(clip, chosen_frames(clip, POSES), CELL)
    paper = Paper(Image.new("RGB", TILE, theme.paper), theme)
    for y, size, text, colour in ((0, 15, caption, theme.ink), (21, 11, facts_of(clip), theme.muted)):
        paper.text((0, y), paper.wrap(text, size, TILE[0], lines=1)[0], size, colour)
    for column, frame in enumerate(strip.frames):
        paper.image.paste(draw_pose(strip, column, theme), (column * CELL[0], TEXT))
        middle = (column + 0.5) * CELL[0]
        paper.text((middle, TEXT + CELL[1] + 1), f"{frame / clip.fps:.2f} s", 10, theme.muted, align="centre")
    draw_lanes(paper, strip, (0, TEXT + CELL[1] + 17), LANE)
    return paper.image


def overview(tiles: Iterable[Image.Image], count: int, title: str, *, theme: Theme) -> Image.Image:
    """Return a sheet of tiles from `draw_tile`, row by row.

    Args:
        count: number of tiles; the sheet is allocated before they arrive.

    Raises:
        InvalidInput: none, or more than `MOST_TILES`.
    """
    if not 1 <= count <= MOST_TILES:
        raise InvalidInput(f"{count} motions; an overview takes 1 to {MOST_TILES}")
    step = TILE[0] + GAP[0], TILE[1] + GAP[1]
    across = min(ACROSS, count, ceil(sqrt(1.4 * count * step[1] / step[0])))
    down = ceil(count / across)
    width, head = across * step[0] - GAP[0] + 2 * MARGIN, MARGIN - 8 + 56
    paper = Paper(Image.new("RGB", (width, head + down * step[1] + 46), theme.paper), theme)
    paper.text((MARGIN, MARGIN - 8), paper.wrap(title, 26, width - 2 * MARGIN, lines=1)[0], 26, theme.ink)
    for number, tile in enumerate(tiles):
        paper.image.paste(tile, (MARGIN + number % across * step[0], head + number // across * step[1]))
    draw_legend(paper)
    return paper.image
