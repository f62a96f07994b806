"""Films as mp4, GIF and WebP files. No display is needed, and equal clips give equal bytes with the same versions of
the encoders."""

from __future__ import annotations

import io
import tempfile
from collections.abc import Iterator
from fractions import Fraction
from importlib import import_module
from itertools import pairwise
from pathlib import Path
from typing import Any

from PIL import Image

from marey.core.errors import TooLarge
from marey.motion.clip import MotionClip
from marey.viz.film import Film

GIF_RATE, WEBP_RATE, MP4_RATE = 30.0, 30.0, 60.0
"""Largest rates. A GIF counts hundredths of a second, and browsers slow down pictures of one of them."""
MAX_PICTURES = 1200
"""Of a GIF or WebP, whose pictures are all in memory until the end: 0.6 GB."""
COLOURS, PALETTE_PICTURES = 128, 8
QUALITY = 75
X264 = {"crf": "20", "preset": "veryfast", "threads": "1"}
"""Options of the encoder; on one thread its output is the same every time."""


def mp4_bytes(clip: MotionClip) -> bytes:
    """Encode a clip as mp4: H.264, 4:2:0, without sound. Needs PyAV (extra `video`).

    Raises:
        ImportError: PyAV is not installed.
    """
    av: Any = import_module("av")  # its types are unknown in part
    film = Film(clip, MP4_RATE)
    with tempfile.TemporaryDirectory() as folder:  # the index comes before the pictures, which takes a second pass
        path = Path(folder) / "film.mp4"
        with av.open(path, "w", format="mp4", options={"movflags": "+faststart", "fflags": "+bitexact"}) as container:
            stream = container.add_stream("libx264", rate=_rate(film.fps), options=X264)
            stream.width, stream.height = film.size
            stream.pix_fmt = "yuv420p"
            for picture in film:
                container.mux(stream.encode(av.VideoFrame.from_image(picture)))
            container.mux(stream.encode(None))
        return path.read_bytes()


def gif_bytes(clip: MotionClip) -> bytes:
    """Encode a clip as a GIF that plays for ever, of one palette.

    Raises:
        TooLarge: more than `MAX_PICTURES` pictures.
    """
    film = _short(Film(clip, GIF_RATE))
    palette = _palette(film)

    def pictures() -> Iterator[Image.Image]:
        return (picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in film)

    durations = [10 * hundredths for hundredths in _durations(film, 100)]
    return _animated(pictures(), "GIF", duration=durations, loop=0, disposal=1, optimize=False)


def webp_bytes(clip: MotionClip) -> bytes:
    """Encode a clip as an animated WebP that plays for ever.

    Raises:
        TooLarge: more than `MAX_PICTURES` pictures.
    """
    film = _short(Film(clip, WEBP_RATE))
    return _animated(iter(film), "WEBP", duration=_durations(film, 1000), loop=0, quality=QUALITY, method=0)


def _animated(pictures: Iterator[Image.Image], kind: str, **options: object) -> bytes:
    buffer = io.BytesIO()
    next(pictures).save(buffer, kind, save_all=True, append_images=pictures, **options)
    return buffer.getvalue()


def _short(film: Film) -> Film:
    if len(film) > MAX_PICTURES:
        raise TooLarge(
            f"{len(film)} pictures, over the limit of {MAX_PICTURES} of animated pictures",
            hint="Write an mp4, or a lower rate (--fps).",
        )
    return film


def _durations(film: Film, units: int) -> list[int]:
    """Return how long each picture is shown, in whole parts of a second that add up to the film's length."""
    ends = [round(units * picture / film.fps) for picture in range(len(film) + 1)]
    return [end - begin for begin, end in pairwise(ends)]


def _palette(film: Film) -> Image.Image:
    """Return a picture with the palette of some pictures of the film, evenly spread."""
    count = min(PALETTE_PICTURES, len(film))
    shown = [film.picture(round(k * (len(film) - 1) / max(count - 1, 1))) for k in range(count)]
    width, height = film.size
    sheet = Image.new("RGB", (width, height * count))
    for row, picture in enumerate(shown):
        sheet.paste(picture, (0, row * height))
    return sheet.quantize(COLOURS, method=Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)


def _rate(fps: float) -> Fraction:
    """Return a rate as programs write it: 23.976… is 24000/1001."""
    return Fraction(fps).limit_denominator(1001)
