"""GIF: a film of the motion that plays for ever. Only written, on request; no prompt is in it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from marey.exporters.exporter import Coordinates, Exporter

if TYPE_CHECKING:
    from marey.motion.clip import MotionClip


def encode(clip: MotionClip, coordinates: Coordinates) -> bytes:
    """Draw a clip.

    Raises:
        TooLarge: too many pictures for an animated one.
    """
    from marey.viz.video import gif_bytes

    return gif_bytes(clip)


EXPORTER: Exporter[MotionClip] = Exporter(
    format="gif",
    media_type="image/gif",
    extension="gif",
    holds_prompt=False,
    encode=encode,
    stored=False,
)
