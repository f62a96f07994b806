"""Conversion between motion files, with another rate, unit or axis on request: `marey convert` calls it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from marey.core.errors import Conflict, InvalidInput
from marey.exporters.exporter import Coordinates, Exporter
from marey.exporters.registry import check_writers, exporter_for
from marey.motion.clip import MAX_UNPACKED, MotionClip
from marey.motion.export_options import PLAIN, ExportOptions, RestPose
from marey.motion.files import check_folder_of, read_limited, write_atomically
from marey.motion.io.bvh import BvhClip
from marey.motion.io.convert import clip_from_bvh, resample_bvh
from marey.motion.resample import resample
from marey.motion.units import Unit, Up


def convert(
    source: Path | str,
    target: Path | str,
    *,
    fps: float | None = None,
    unit: Unit = "cm",
    up: Up = "y",
    export: ExportOptions = PLAIN,
    source_unit: Unit = "cm",
    source_up: Up = "y",
    source_rest_pose: RestPose = "t",
    overwrite: bool = False,
) -> tuple[str, ...]:
    """Convert a motion file; the extensions of the names tell the formats.

    Args:
        source, target: files of installed formats, such as `.bvh` and `.npz`.
        fps: rate of the result, in frames a second; None = the source's.
        unit, up: of a result whose format leaves them open, such as BVH; npz is always metres and Y up.
        export: options of the result, such as a root bone.
        source_unit, source_up, source_rest_pose: of such a source.
        overwrite: replace an existing file.

    Returns:
        Notes on oddities of a BVH source.

    Raises:
        MissingExtra: an extra that writes the format of the result is not installed.
        InvalidInput: a target without a folder, a format that is unknown or write-only, a rate out of bounds, an option
            that the format of the result does not have, or a skeleton without that rest pose.
        Conflict: the target exists.
        NotFound, InvalidFile, TooLarge: from reading.
    """
    source, target = Path(source), Path(target)
    reader, writer = exporter_for(source), exporter_for(target)
    check_writers([writer], export)
    if target.exists() and not overwrite:
        raise Conflict("already exists", where=str(target), hint="Choose another name, or allow overwriting.")
    check_folder_of(target)
    clip = _decode(reader, source, Coordinates(source_unit, source_up, rest_pose=source_rest_pose))
    notes: tuple[str, ...] = ()
    if isinstance(clip, BvhClip):
        notes = clip.notes
        clip = clip if fps is None else resample_bvh(clip, fps)
        clip = (
            clip
            if writer is reader and export.rig is None and export.body is None
            else clip_from_bvh(clip, source.name)
        )
    elif fps is not None:
        clip = resample(clip, fps)
    write_atomically(target, writer.write(clip, Coordinates.of(export, unit, up)))
    return notes


def read_motion(path: Path, coordinates: Coordinates) -> MotionClip:
    """Read a motion file of any installed format.

    Args:
        coordinates: unit and axis of a file whose format leaves them open.

    Raises:
        InvalidInput: a format that is unknown or write-only.
        NotFound, InvalidFile, TooLarge: from reading.
    """
    clip = _decode(exporter_for(path), path, coordinates)
    return clip_from_bvh(clip, path.name) if isinstance(clip, BvhClip) else clip


def _decode(reader: Exporter[Any], path: Path, coordinates: Coordinates) -> MotionClip | BvhClip:
    if reader.decode is None:
        raise InvalidInput(f"{reader.format} files can be written, but not read", where=str(path))
    return reader.decode(read_limited(path, MAX_UNPACKED), str(path), coordinates)
