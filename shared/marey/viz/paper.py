"""Drawing surface: colours, type, wrapped lines."""

from __future__ import annotations

import bisect
import unicodedata
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Literal

from PIL import Image, ImageDraw, ImageFont

from marey.core.errors import InvalidInput
from marey.viz.body import Part

Colour = tuple[int, int, int]

NO_LETTER = "\uffff"
"""A code point that no font draws: its picture is that of a missing letter."""
PLAIN = {
    "–": "-",
    "—": "-",
    "−": "-",
    "×": "x",
    "ß": "ss",
    "æ": "ae",
    "Æ": "AE",
    "œ": "oe",
    "Œ": "OE",
    "ø": "o",
    "Ø": "O",
    "ł": "l",
    "Ł": "L",
    "đ": "d",
    "Đ": "D",
    "ð": "d",
    "þ": "th",
    "ı": "i",
}
"""Letters in place of those that the font does not have and that are no letter with an accent."""  # fmt: skip


@dataclass(frozen=True)
class Theme:
    """Colours of a sheet, sRGB. Blue and orange are distinct for colour-blind viewers."""

    paper: Colour
    ink: Colour
    muted: Colour
    line: Colour
    floor: Colour
    shadow: Colour
    parts: Mapping[Part, Colour] = field(
        default_factory=lambda: {
            "left": (56, 134, 214),
            "right": (236, 122, 48),
            "middle": (206, 200, 190),
            "face": (150, 143, 133),
        }
    )


THEMES = {
    "light": Theme(
        paper=(250, 249, 246),
        ink=(27, 30, 35),
        muted=(118, 122, 129),
        line=(214, 210, 201),
        floor=(239, 236, 230),
        shadow=(92, 84, 74),
    ),
    "dark": Theme(
        paper=(20, 22, 26),
        ink=(238, 236, 231),
        muted=(146, 150, 158),
        line=(58, 62, 70),
        floor=(31, 34, 40),
        shadow=(4, 5, 7),
    ),
}


def theme_named(name: str) -> Theme:
    """Return a theme by name.

    Raises:
        InvalidInput: the name is unknown.
    """
    if name not in THEMES:
        raise InvalidInput(f"unknown theme {name!r}", hint=f"One of: {', '.join(THEMES)}.")
    return THEMES[name]


def blend(under: Colour, over: Colour, share: float) -> Colour:
    """Return a mix with `share` of one colour over another."""
    r, g, b = (round(u + (o - u) * share) for u, o in zip(under, over, strict=True))
    return r, g, b


def one_line(text: str) -> str:
    """Return any text as one printable line: line breaks and control characters become spaces."""
    return " ".join("".join(" " if unicodedata.category(c).startswith(("C", "Z")) else c for c in text).split())


@lru_cache(maxsize=32)
def _font(size: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    return ImageFont.load_default(size)  # Aileron, part of Pillow: the same sheet on every machine


@lru_cache(maxsize=4096)
def _drawable(text: str) -> str:
    """Return a text in the letters of the font, which has no accents: "café" becomes "cafe". Letters that have no such
    form stay, and are drawn as boxes."""
    return "".join(c if c.isascii() or _has_glyph(c) else _plain(c) for c in text)


def _plain(letter: str) -> str:
    likeness = PLAIN.get(letter) or unicodedata.normalize("NFKD", letter)
    marked = "".join(c for c in likeness if not unicodedata.combining(c))
    return marked if all(map(_has_glyph, marked)) else letter


def _has_glyph(letter: str) -> bool:
    return _picture(letter) != _picture(NO_LETTER)


@lru_cache(maxsize=1024)
def _picture(letter: str) -> bytes:
    image = Image.new("L", (40, 40))
    ImageDraw.Draw(image).text((0, 0), letter, fill=255, font=_font(20))
    return image.tobytes()


@dataclass(frozen=True)
class Paper:
    """An image to draw text and shapes on."""

    image: Image.Image
    theme: Theme

    def text(
        self,
        at: tuple[float, float],
        text: str,
        size: int,
        colour: Colour,
        align: Literal["left", "centre", "right"] = "left",
    ) -> None:
        """Draw one line; `at` is the left end, centre or right end of its top."""
        anchor = {"left": "la", "centre": "ma", "right": "ra"}[align]
        ImageDraw.Draw(self.image).text(at, _drawable(text), fill=colour, font=_font(size), anchor=anchor)

    def length(self, text: str, size: int) -> float:
        """Return the width of a line in pixels."""
        return ImageDraw.Draw(self.image).textlength(_drawable(text), font=_font(size))

    def wrap(self, text: str, size: int, width: float, *, lines: int) -> list[str]:
        """Break text at words into at most `lines` lines; a longer text ends in an ellipsis."""
        words, broken = one_line(text).split(), list[str]()
        while words and len(broken) < lines:
            line = words.pop(0)
            while words and self.length(f"{line} {words[0]}", size) <= width:
                line += " " + words.pop(0)
            broken.append(line)
        if words and broken:
            broken[-1] += "…"
        return [self._shorten(line, size, width) for line in broken] or [""]

    def _shorten(self, line: str, size: int, width: float) -> str:
        if self.length(line, size) <= width:
            return line
        line = line.rstrip("…")
        # Find the longest prefix that fits by bisection: a prompt may be one word of thousands of letters.
        fits = bisect.bisect_right(range(len(line)), width, key=lambda n: self.length(line[:n] + "…", size)) - 1
        return line[: max(fits, 0)].rstrip() + "…"
