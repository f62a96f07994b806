"""FBX: skeleton, bind pose and motion, for Unreal, Unity, Maya, MotionBuilder and Blender. No prompt is in it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from marey.exporters.exporter import Coordinates, Exporter
from marey.exporters.prepare import with_body

if TYPE_CHECKING:
    from marey.motion.clip import MotionClip
    from marey.motion.io.bvh import BvhClip
    from marey.motion.rigs.rigged import RiggedMotion


def encode(clip: MotionClip | BvhClip, coordinates: Coordinates) -> bytes:
    """Write a binary FBX file, version 7.4.

    Raises:
        InvalidInput: see `marey.motion.io.fbx_write.write_fbx`; or the skeleton has no such rest pose.
    """
    from marey.motion.io.fbx_write import format_fbx

    posed, body = with_body(clip, coordinates)
    return format_fbx(posed, coordinates, body, unit=coordinates.unit, up=coordinates.up)


def encode_rigged(motion: RiggedMotion, coordinates: Coordinates) -> bytes:
    """Write a motion on a rig: in the unit and axes of its file if that is FBX, else in centimetres, Y up.

    Raises:
        InvalidInput: see `marey.motion.io.rigged_fbx.format_rigged_fbx`.
    """
    from marey.motion.io.rigged_fbx import format_rigged_fbx

    return format_rigged_fbx(motion)


def decode(data: bytes, where: str, coordinates: Coordinates) -> BvhClip:
    """Read a binary FBX file with its own skeleton, rest pose and facing; bones get a constant length. The file states
    its unit and axes.

    Raises:
        InvalidFile, TooLarge: see `marey.motion.io.fbx_read.read_fbx`.
    """
    from marey.motion.io.convert import steady
    from marey.motion.io.fbx_read import parse_fbx

    return steady(parse_fbx(data, where))


EXPORTER = Exporter(
    format="fbx",
    media_type="application/octet-stream",
    extension="fbx",
    holds_prompt=False,
    encode=encode,
    decode=decode,
    options=frozenset(
        {"root_bone", "in_place", "tpose_frame", "rest_pose", "placement", "mesh", "rig", "rig_map", "names"}
    ),
    encode_rigged=encode_rigged,
    stored=False,
)
