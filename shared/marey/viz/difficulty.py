"""Heat maps of difficulty: which tokens of a motion a model finds hard, over time, under its poses.

As a picture, the contact sheet with one more track a motion; as a page, the same with the numbers of each token.
"""

from __future__ import annotations

import base64
import html
import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from marey.core.characters import escape
from marey.core.errors import InvalidInput
from marey.motion.clip import MotionClip
from marey.motion.files import write_atomically
from marey.viz.pages import asset, whole_page
from marey.viz.paper import Colour, Paper, Theme, blend, one_line, theme_named
from marey.viz.render import CELL, COLUMNS, draw_row, save_png, stack_rows
from marey.viz.strip import chosen_frames

HARD: Colour = (158, 38, 24)
TALL, TOP = 26, 8  # pixels of the track, and over it
LABEL = "difficulty of each token, within the motion: darker is harder"


@dataclass(frozen=True)
class TokenDifficulty:
    """Difficulty of a motion's tokens.

    Attributes:
        values: (n,) 0 = the easiest token of the motion, 1 = its hardest.
        seconds: of a token.
    """

    values: NDArray[np.float32]
    seconds: float


def normalized(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Scale difficulties (n,) of a motion to 0 to 1 (HGM³ Fig. 5); all 0 where they are equal."""
    low, spread = values.min(initial=np.inf), np.ptp(values) if len(values) else 0.0
    return (values - low) / spread if spread > 0 else np.zeros_like(values)


def draw_difficulty(
    clips: Sequence[MotionClip],
    difficulties: Sequence[TokenDifficulty],
    path: Path,
    *,
    captions: Sequence[str],
    columns: int = COLUMNS,
    title: str | None = None,
    theme: str = "light",
) -> Path:
    """Draw clips as strips of poses with the difficulty of their tokens below, into a PNG, or into a page where each
    token shows its time and difficulty under the pointer.

    Raises:
        InvalidInput: nothing to draw, an unknown theme, or a path that is not a writable PNG or HTML file.
    """
    ending = path.suffix.lower()
    if ending not in (".png", ".html", ".htm"):
        raise InvalidInput(
            f"difficulty is drawn into a .png or .html, not {ending or 'a name without ending'}", where=str(path)
        )
    if not clips:
        raise InvalidInput("no clip to draw", hint="Give at least one.")
    paper = theme_named(theme)
    motions = list(zip(clips, difficulties, captions, strict=True))
    if ending == ".png":
        return save_png(stack_rows([_row(*each, columns, paper) for each in motions], title, theme=paper), path)
    head = one_line(title or captions[0]) or "Marey"
    sections = "".join(_section(*each, columns, paper) for each in motions)
    body = f"<body>\n<h1>{_text(head)}</h1>\n<p>{LABEL}</p>\n{sections}</body>\n"
    page = whole_page(body, title=head, styles=[asset("difficulty.css")], theme=theme)
    write_atomically(path, page.encode())
    return path


def _row(clip: MotionClip, difficulty: TokenDifficulty, caption: str, columns: int, theme: Theme) -> Image.Image:
    poses = draw_row(clip, caption, chosen_frames(clip, columns, None), columns=columns, theme=theme)
    paper = Paper(Image.new("RGB", (poses.width, poses.height + TOP + TALL + 20), theme.paper), theme)
    paper.image.paste(poses, (0, 0))
    draw, top = ImageDraw.Draw(paper.image), poses.height + TOP
    edges = _edges(clip, difficulty, columns)
    for left, right, value in zip(edges[:-1], edges[1:], difficulty.values, strict=True):
        draw.rectangle([left, top, max(right - 1, left), top + TALL - 1], fill=_colour(float(value), theme))
    paper.text((edges[0], top + TALL + 4), LABEL, 12, theme.muted)
    return paper.image


def _section(clip: MotionClip, difficulty: TokenDifficulty, caption: str, columns: int, theme: Theme) -> str:
    poses = draw_row(clip, caption, chosen_frames(clip, columns, None), columns=columns, theme=theme)
    buffer = io.BytesIO()
    poses.save(buffer, format="PNG", compress_level=5)
    picture = base64.b64encode(buffer.getvalue()).decode("ascii")
    edges = _edges(clip, difficulty, columns)
    tokens = [
        f'<rect x="{left:.1f}" y="0" width="{right - left:.1f}" height="{TALL}" '
        f'fill="rgb{_colour(float(value), theme)}">'
        f"<title>token {number}, {number * difficulty.seconds:.2f} s: {value:.2f}</title></rect>"
        for number, (left, right, value) in enumerate(zip(edges[:-1], edges[1:], difficulty.values, strict=True))
    ]
    return (
        f'<section>\n<img alt="{_text(caption)}" src="data:image/png;base64,{picture}">\n'
        f'<svg viewBox="0 0 {poses.width} {TALL}" role="img" aria-label="{LABEL}">{"".join(tokens)}</svg>\n</section>\n'
    )


def _edges(clip: MotionClip, difficulty: TokenDifficulty, columns: int) -> NDArray[np.float64]:
    """Return the left edge of each token, and the right edge of the last (n + 1,), in pixels under the poses."""
    frames = chosen_frames(clip, columns, None)
    centres = (np.arange(len(frames)) + 0.5) * CELL[0]
    times = np.arange(len(difficulty.values) + 1) * difficulty.seconds * clip.fps
    return np.interp(times, frames, centres)


def _colour(value: float, theme: Theme) -> Colour:
    return blend(theme.floor, HARD, value)


def _text(text: str) -> str:
    return html.escape(escape(one_line(text), lines=False))
