"""Export of a finished clip: the files that are stored of every motion."""

from __future__ import annotations

from marey.exporters import Coordinates, exporters
from marey.motion.clip import MotionClip
from marey.runtime.export_types import Export, ExportedFile


def export_clip(clip: MotionClip, licence: str) -> Export:
    """Encode a clip in every installed format that is stored, in memory."""
    return Export(
        files=tuple(
            ExportedFile(each.format, each.encode(clip, Coordinates()), each.media_type)
            for each in exporters().values()
            if each.stored
        ),
        frames=clip.frames,
        fps=clip.fps,
        licence=licence,
        manifest=clip.manifest,
    )
