"""Frames of a live stream, read with the standard library alone; `docs/reference/streams.md` describes their bytes."""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass, field

from marey.core.errors import InvalidInput

HEADER = struct.Struct("<2sBBIHH3f")
MAGIC, VERSION = b"MF", 1
JOINT_BYTES = 8
MOST_JOINTS = 512
LAST = 1 << 4
SCALE = 32767.0
OFF_UNIT = 1e-3
"""Tolerance of a quaternion's length: rounding changes it by 3e-5, foreign bytes by far more."""
RELEASES = "client and server are of different releases: update the older one"

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
    if len(data) < HEADER.size:
        raise InvalidInput(f"{len(data)} bytes; a frame has at least {HEADER.size}", where="frame")
    magic, version, flags, number, count, prompt, *root = HEADER.unpack_from(data)
    if magic != MAGIC:
        raise InvalidInput(f"begins with {magic!r}, not {MAGIC!r}: not a frame of a Marey stream", where="frame")
    if version != VERSION:
        raise InvalidInput(f"version {version}; this program reads {VERSION}", where="frame", hint=RELEASES)
    where, size = f"frame {number}", HEADER.size + JOINT_BYTES * count
    if flags >= LAST << 1:
        raise InvalidInput(f"flags {flags:#04x} hold bits that version {VERSION} does not have", where=where)
    if not 1 <= count <= MOST_JOINTS or count != (joints or count):
        raise InvalidInput(f"{count} joints, not {joints or f'1 to {MOST_JOINTS}'}", where=where)
    if len(data) != size:
        raise InvalidInput(f"{len(data)} bytes, not the {size} of {count} joints", where=where)
    if not all(map(math.isfinite, root)):
        raise InvalidInput("the root holds NaN or infinite numbers", where=where)
    numbers = struct.unpack_from(f"<{4 * count}h", data, HEADER.size)
    turns = tuple(_unit(numbers[4 * joint : 4 * joint + 4], joint, where) for joint in range(count))
    left, left_toe, right, right_toe = (bool(flags >> bit & 1) for bit in range(4))
    x, y, z = root
    return Frame(number, prompt, (x, y, z), turns, (left, left_toe, right, right_toe), bool(flags & LAST), data)


def _unit(turn: tuple[int, ...], joint: int, where: str) -> Quaternion:
    length = math.hypot(*turn)
    if not abs(length / SCALE - 1.0) <= OFF_UNIT:
        raise InvalidInput(f"the rotation of joint {joint} has not length 1", where=where)
    w, x, y, z = (each / length for each in turn)
    return (w, x, y, z)
