"""Frames of a live stream, read with the standard library alone; `marey.core.frame_layout` describes their bytes."""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass, field

from marey.core.errors import InvalidInput
from marey.core.frame_layout import HEADER, OFF_UNIT, SCALE, read_header

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


@dataclass(frozen=True)
class Frame:
    """A pose of a live stream.

    Attributes:
        number: from 0.
        prompt: number of the current prompt, from 0; each steer adds one.
        root: x, y, z in metres, Y up.
        rotations: for each joint its local unit quaternion w, x, y, z, in the order of the stream's skeleton.
        contacts: whether the left ankle, left toe, right ankle and right toe touch the floor.
        last: True for the last frame of the stream.
        data: the bytes of the frame.
    """

    number: int
    prompt: int
    root: Vector
    rotations: tuple[Quaternion, ...] = field(repr=False)
    contacts: tuple[bool, bool, bool, bool]
    last: bool
    data: bytes = field(repr=False)


def read_frame(data: bytes, *, joints: int | None = None) -> Frame:
    """Read a frame.

    Args:
        joints: number of joints of the stream's skeleton; None = unknown.

    Raises:
        InvalidInput: truncated, foreign, of another version or of another skeleton.
    """
    header = read_header(data, joints=joints)
    where = f"frame {header.number}"
    if not all(map(math.isfinite, header.root)):
        raise InvalidInput("the root holds NaN or infinite numbers", where=where)
    numbers = struct.unpack_from(f"<{4 * header.joints}h", data, HEADER.size)
    turns = tuple(_unit(numbers[4 * joint : 4 * joint + 4], joint, where) for joint in range(header.joints))
    return Frame(header.number, header.prompt, header.root, turns, header.contacts, header.last, data)


def _unit(turn: tuple[int, ...], joint: int, where: str) -> Quaternion:
    length = math.hypot(*turn)
    if not abs(length / SCALE - 1.0) <= OFF_UNIT:
        raise InvalidInput(f"the rotation of joint {joint} has not length 1", where=where)
    w, x, y, z = (each / length for each in turn)
    return (w, x, y, z)
