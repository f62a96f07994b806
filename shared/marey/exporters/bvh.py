"""BVH: the skeleton and its motion. Files hold no comments, so no prompt."""

from __future__ import annotations

from typing import TYPE_CHECKING

from marey.exporters.exporter import Coordinates, Exporter
from marey.exporters.prepare import in_rest_pose

if TYPE_CHECKING:
    from marey.motion.clip import MotionClip
    from marey.motion.io.bvh import BvhClip
    from marey.motion.rigs.rigged import RiggedMotion


def encode(clip: MotionClip | BvhClip, coordinates: Coordinates) -> bytes:
    """Write a BVH file.

    Raises:
        InvalidInput: see `marey.motion.io.bvh.write_bvh`; or the skeleton has no such rest pose.
    """
    from marey.motion.io.bvh_write import format_bvh

    clip = in_rest_pose(clip, coordinates)
    return format_bvh(clip, unit=coordinates.unit, up=coordinates.up, options=coordinates).encode()


def encode_rigged(motion: RiggedMotion, coordinates: Coordinates) -> bytes:
    """Write a motion on a rig.

    Raises:
        InvalidInput: see `marey.motion.io.rigged_bvh.format_rigged_bvh`.
    """
    from marey.motion.io.rigged_bvh import format_rigged_bvh

    return format_rigged_bvh(motion, unit=coordinates.unit, up=coordinates.up, options=coordinates).encode()


def decode(data: bytes, where: str, coordinates: Coordinates) -> BvhClip:
    """Read a BVH file with its own skeleton and facing, in the T-pose if its skeleton is known; bones get a constant
    length.

    Raises:
        InvalidFile, TooLarge: see `marey.motion.io.bvh.read_bvh`.
        InvalidInput: the skeleton has no such rest pose.
    """
    from marey.motion.io.bvh import parse_bvh
    from marey.motion.io.convert import steady

    clip = steady(parse_bvh(data, where, unit=coordinates.unit, up=coordinates.up))
    if coordinates.rest_pose == "t":
        return clip
    from marey.motion.rest_pose import change_rest_pose

    return change_rest_pose(clip, "t")


EXPORTER = Exporter(
    format="bvh",
    media_type="text/plain; charset=utf-8",
    extension="bvh",
    holds_prompt=False,
    encode=encode,
    decode=decode,
    options=frozenset(
        {"bvh_root", "root_bone", "in_place", "tpose_frame", "rest_pose", "placement", "rig", "rig_map", "names"}
    ),
    encode_rigged=encode_rigged,
)
