"""VRM animation: the motion for VRM avatars. Only written, on request; no prompt is in it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from marey.exporters.exporter import Coordinates, Exporter

if TYPE_CHECKING:
    from marey.motion.clip import MotionClip


def encode(clip: MotionClip, coordinates: Coordinates) -> bytes:
    """Write a VRM animation.

    Raises:
        InvalidInput: see `marey.motion.io.vrma_write.format_vrma`.
    """
    from marey.motion.io.vrma_write import format_vrma

    return format_vrma(clip, coordinates)


EXPORTER: Exporter[MotionClip] = Exporter(
    format="vrma",
    media_type="model/gltf-binary",
    extension="vrma",
    holds_prompt=False,
    encode=encode,
    options=frozenset({"in_place", "tpose_frame", "placement"}),
    stored=False,
)
