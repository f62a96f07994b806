"""mp4: a film of the motion, H.264. Only written, on request; no prompt is in it."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from marey.exporters.exporter import Coordinates, Exporter

if TYPE_CHECKING:
    from marey.motion.clip import MotionClip
    from marey.motion.export_options import ExportOptions


def encode(clip: MotionClip, coordinates: Coordinates) -> bytes:
    """Draw a clip.

    Raises:
        MissingExtra: PyAV is not installed.
    """
    from marey.viz.video import mp4_bytes

    check(coordinates)
    return mp4_bytes(clip)


def check(options: ExportOptions) -> None:
    """Validate that PyAV is installed.

    Raises:
        MissingExtra: it is not.
    """
    from marey.core.extras import extra

    with extra("video"):
        import_module("av")


EXPORTER: Exporter[MotionClip] = Exporter(
    format="mp4",
    media_type="video/mp4",
    extension="mp4",
    holds_prompt=False,
    encode=encode,
    stored=False,
    check=check,
)
