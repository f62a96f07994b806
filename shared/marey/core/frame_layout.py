"""Bytes of one frame of a live stream: root position and joint rotations; the client and the server both read it.

    offset  size  content (little-endian)
    0       2     `MF`
    2       1     version, 1
    3       1     flags: bits 0 to 3 contacts (L ankle, L toe, R ankle, R toe), bit 4 last frame of the stream; others 0
    4       4     uint32 number of the frame, from 0
    8       2     uint16 J, joints
    10      2     uint16 number of the prompt that was in force, from 0; each steer adds one
    12      12    float32 x y z of the root, metres, Y up
    24      8 J   int16 w x y z of each joint's local rotation, times 32,767

The order of joints, their parents and offsets are those of the stream's skeleton, which a client reads once.
Together they drive a rig by forward kinematics alone.

Rotations are quantised, the root is not. A rotation is off by at most 0.004 degrees, less than 0.3 mm at any joint
of a body, for half the bytes (200 a frame on 22 joints, 376 with float32). A root, which may walk for hours, has no
range to quantise over. Eight bytes per joint rather than six (the smallest three components) let a browser read one
`Int16Array`, without bit arithmetic.
"""

from __future__ import annotations

import struct
from typing import NamedTuple

from marey.core.errors import InvalidInput

HEADER = struct.Struct("<2sBBIHH3f")
MAGIC, VERSION = b"MF", 1
JOINT_BYTES = 8
MOST_JOINTS = 512
LAST = 1 << 4
"""Flag of the last frame of a stream."""
SCALE = 32767.0
OFF_UNIT = 1e-3
"""Tolerance of a quaternion's length: rounding changes it by 3e-5, foreign bytes by far more."""


class FrameHeader(NamedTuple):
    """The first `HEADER.size` bytes of a frame.

    Attributes:
        number: of the frame, from 0.
        joints: J.
        prompt: number of the prompt in force, from 0.
        root: x, y, z in metres, Y up; may be NaN or infinite in foreign bytes.
        contacts: the left ankle, left toe, right ankle and right toe stand.
        last: True for the last frame of the stream.
    """

    number: int
    joints: int
    prompt: int
    root: tuple[float, float, float]
    contacts: tuple[bool, bool, bool, bool]
    last: bool


def frame_bytes(joints: int) -> int:
    """Return the size of a frame of a skeleton, in bytes."""
    return HEADER.size + JOINT_BYTES * joints


def read_header(data: bytes, *, joints: int | None = None) -> FrameHeader:
    """Read the header of a frame, and check the size of the whole frame.

    Args:
        data: exactly one frame.
        joints: J of the stream's skeleton; None = unknown.

    Raises:
        InvalidInput: truncated, foreign, of another version or of another skeleton.
    """
    if len(data) < HEADER.size:
        raise InvalidInput(f"{len(data)} bytes; a frame has at least {HEADER.size}", where="frame")
    magic, version, flags, number, count, prompt, x, y, z = HEADER.unpack_from(data)
    if magic != MAGIC:
        raise InvalidInput(f"begins with {magic!r}, not {MAGIC!r}: not a frame of a Marey stream", where="frame")
    if version != VERSION:
        hint = "client and server are of different releases: update the older one"
        raise InvalidInput(f"version {version}; this program reads {VERSION}", where="frame", hint=hint)
    where = f"frame {number}"
    if flags >= LAST << 1:
        raise InvalidInput(f"flags {flags:#04x} hold bits that version {VERSION} does not have", where=where)
    if not 1 <= count <= MOST_JOINTS or count != (joints or count):
        raise InvalidInput(f"{count} joints, not {joints or f'1 to {MOST_JOINTS}'}", where=where)
    if len(data) != frame_bytes(count):
        raise InvalidInput(f"{len(data)} bytes, not the {frame_bytes(count)} of {count} joints", where=where)
    left, left_toe, right, right_toe = (bool(flags >> bit & 1) for bit in range(4))
    return FrameHeader(number, count, prompt, (x, y, z), (left, left_toe, right, right_toe), bool(flags & LAST))
