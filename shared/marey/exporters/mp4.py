"""mp4: a film of the motion, H.264. Only written, on request; no prompt is in it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from marey.exporters.exporter import Coordinates, Exporter

if TYPE_CHECKING:
    from marey.motion.clip import MotionClip


def encode(clip: MotionClip, coordinates: Coordinates) -> bytes:
    """Draw a clip.

    Raises:
        InvalidInput: the extra `video` is not installed.
    """
    from marey.core.extras import needs_extra
    from marey.viz.video import mp4_bytes

    try:
        return mp4_bytes(clip)
    except ImportError as error:
        raise needs_extra("video", error) from error


EXPORTER: Exporter[MotionClip] = Exporter(
    format="mp4",
    media_type="video/mp4",
    extension="mp4",
    holds_prompt=False,
    encode=encode,
    stored=False,
)
