"""BVH: the skeleton and its motion. Files hold no comments, so no prompt."""

from __future__ import annotations

from typing import TYPE_CHECKING

from marey.exporters.exporter import Coordinates, Exporter

if TYPE_CHECKING:
    from marey.motion.clip import MotionClip
    from marey.motion.io.bvh import BvhClip


def encode(clip: MotionClip | BvhClip, coordinates: Coordinates) -> bytes:
    """Write a BVH file.

    Raises:
        InvalidInput: see `marey.motion.io.bvh.write_bvh`.
    """
    from marey.motion.io.bvh_write import format_bvh

    return format_bvh(clip, unit=coordinates.unit, up=coordinates.up, options=coordinates).encode()


def decode(data: bytes, where: str, coordinates: Coordinates) -> BvhClip:
    """Read a BVH file with its own skeleton and facing; bones get a constant length.

    Raises:
        InvalidFile, TooLarge: see `marey.motion.io.bvh.read_bvh`.
    """
    from marey.motion.io.bvh import parse_bvh
    from marey.motion.io.convert import steady

    return steady(parse_bvh(data, where, unit=coordinates.unit, up=coordinates.up))


EXPORTER = Exporter(
    format="bvh",
    media_type="text/plain; charset=utf-8",
    extension="bvh",
    holds_prompt=False,
    encode=encode,
    decode=decode,
    options=frozenset({"bvh_root", "root_bone", "in_place", "tpose_frame", "placement"}),
)
