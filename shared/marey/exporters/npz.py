"""npz: a clip with its features and its manifest, prompt included."""

from __future__ import annotations

from typing import TYPE_CHECKING

from marey.exporters.exporter import Coordinates, Exporter

if TYPE_CHECKING:
    from marey.motion.clip import MotionClip


def encode(clip: MotionClip, coordinates: Coordinates) -> bytes:
    """Write an npz: always in metres, Y up."""
    return clip.to_npz()


def decode(data: bytes, where: str, coordinates: Coordinates) -> MotionClip:
    """Read an npz.

    Raises:
        InvalidFile, TooLarge: see `marey.motion.clip.load_npz`.
    """
    from marey.motion.clip import parse_npz

    return parse_npz(data, where)


EXPORTER = Exporter(
    format="npz",
    media_type="application/x-npz",
    extension="npz",
    holds_prompt=True,
    encode=encode,
    decode=decode,
)
