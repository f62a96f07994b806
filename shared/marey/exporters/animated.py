"""Films as animated pictures, which play for ever."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from marey.exporters.exporter import Coordinates, Exporter

if TYPE_CHECKING:
    from marey.motion.clip import MotionClip


def animated(format: Literal["gif", "webp"]) -> Exporter[MotionClip]:
    """Return the exporter of a format of animated pictures. Only written, on request; no prompt is in them.

    It raises TooLarge for a clip of too many pictures.
    """

    def encode(clip: MotionClip, coordinates: Coordinates) -> bytes:
        from marey.viz import video

        return video.gif_bytes(clip) if format == "gif" else video.webp_bytes(clip)

    return Exporter(
        format=format,
        media_type=f"image/{format}",
        extension=format,
        holds_prompt=False,
        encode=encode,
        stored=False,
    )
