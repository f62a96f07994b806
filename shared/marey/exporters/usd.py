"""USD: a UsdSkel skeleton and its animation, by Pixar's library (the extra `usd`). Only written; no prompt is in it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from marey.exporters.exporter import Coordinates, Exporter
from marey.exporters.prepare import with_body

if TYPE_CHECKING:
    from marey.motion.clip import MotionClip
    from marey.motion.export_options import ExportOptions
    from marey.motion.rigs.rigged import RiggedMotion


def encode(clip: MotionClip, coordinates: Coordinates) -> bytes:
    """Write a USD file.

    Raises:
        InvalidInput: see `marey.motion.io.usd_write.format_usd`; or the skeleton has no such rest pose.
    """
    from marey.motion.io.usd_write import format_usd

    posed, body = with_body(clip, coordinates)
    return format_usd(posed, coordinates, body, unit=coordinates.unit, up=coordinates.up)


def encode_rigged(motion: RiggedMotion, coordinates: Coordinates) -> bytes:
    """Write a motion on a rig, in centimetres, Y up.

    Raises:
        InvalidInput: see `marey.motion.io.usd_write.format_usd`.
    """
    from marey.motion.io.usd_write import format_rigged_usd

    return format_rigged_usd(motion)


def check(options: ExportOptions) -> None:
    """Validate that `usd-core` is installed.

    Raises:
        MissingExtra: it is not.
    """
    from marey.motion.io.usd_write import load_pxr

    load_pxr()


EXPORTER: Exporter[MotionClip] = Exporter(
    format="usd",
    media_type="model/vnd.usd",
    extension="usd",
    holds_prompt=False,
    encode=encode,
    options=frozenset(
        {"root_bone", "in_place", "tpose_frame", "rest_pose", "placement", "mesh", "rig", "rig_map", "names"}
    ),
    encode_rigged=encode_rigged,
    stored=False,
    check=check,
)
