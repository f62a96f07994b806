"""Binary format of one frame of a live stream: root position and joint rotations.

    offset  size  what (little-endian)
    0       2     `MF`
    2       1     version, 1
    3       1     flags: bits 0 to 3 contacts (L ankle, L toe, R ankle, R toe), bit 4 last frame of the stream; others 0
    4       4     uint32 number of the frame, from 0
    8       2     uint16 J, joints
    10      2     uint16 number of the prompt that was in force, from 0; each steer counts one on
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
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from marey.core.errors import InvalidInput

MAGIC, VERSION = b"MF", 1
HEADER = struct.Struct("<2sBBIHH3f")
JOINT_BYTES = 8
MOST_JOINTS = 512
LAST = 1 << 4
SCALE = 32767.0
OFF_UNIT = 1e-3  # of a quaternion's length: rounding changes it by 3e-5, other data by far more

Float32 = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Frame:
    """A pose of a live stream.

    Attributes:
        number: from 0.
        root: (3,) metres.
        rotations: (J, 4) local unit quaternions `w x y z`.
        contacts: L ankle, L toe, R ankle, R toe stand.
        prompt: number of the prompt in force, from 0.
        last: True for the last frame.
    """

    number: int
    root: Float32 = field(repr=False)
    rotations: Float32 = field(repr=False)
    contacts: tuple[bool, bool, bool, bool] = (False, False, False, False)
    prompt: int = 0
    last: bool = False


def frame_bytes(joints: int) -> int:
    """Return the size of a frame of a skeleton, in bytes."""
    return HEADER.size + JOINT_BYTES * joints


def encode_frame(frame: Frame) -> bytes:
    """Encode a frame.

    Raises:
        InvalidInput: wrong shapes, numbers out of range or not finite, quaternions that are not unit.
    """
    where = f"frame {frame.number}"
    if not 0 <= frame.number < 1 << 32 or not 0 <= frame.prompt < 1 << 16:
        raise InvalidInput(f"number {frame.number} or prompt {frame.prompt} is out of range", where=where)
    root, rotations = _checked(frame.root, frame.rotations, where)
    flags = sum(bool(stands) << bit for bit, stands in enumerate(frame.contacts)) | (LAST if frame.last else 0)
    header = HEADER.pack(MAGIC, VERSION, flags, frame.number, len(rotations), frame.prompt, *root.tolist())
    lengths = np.linalg.norm(rotations, axis=1, keepdims=True)
    return header + np.rint(rotations / lengths * SCALE).astype("<i2").tobytes()


def decode_frame(data: bytes, *, joints: int | None = None) -> Frame:
    """Decode a frame; rotations are unit quaternions again.

    Args:
        data: exactly one frame.
        joints: J of the stream's skeleton, if known.

    Raises:
        InvalidInput: truncated, foreign, of another version or of another skeleton.
    """
    if len(data) < HEADER.size:
        raise InvalidInput(f"{len(data)} bytes; a frame has at least {HEADER.size}", where="frame")
    magic, version, flags, number, count, prompt, *root = HEADER.unpack_from(data)
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
    turns = np.frombuffer(data, "<i2", offset=HEADER.size).reshape(count, 4).astype(np.float64) / SCALE
    place, rotations = _checked(root, turns, where)
    unit = (rotations / np.linalg.norm(rotations, axis=1, keepdims=True)).astype(np.float32)
    left, left_toe, right, right_toe = (bool(flags >> bit & 1) for bit in range(4))
    return Frame(number, place, unit, (left, left_toe, right, right_toe), prompt, bool(flags & LAST))


def _checked(root: ArrayLike, rotations: ArrayLike, where: str) -> tuple[Float32, NDArray[np.float64]]:
    place, turns = np.asarray(root, np.float32), np.asarray(rotations, np.float64)
    if place.shape != (3,) or turns.ndim != 2 or turns.shape[1] != 4 or not 1 <= len(turns) <= MOST_JOINTS:
        message = f"root {place.shape} and rotations {turns.shape}, not (3,) and (J, 4) with J of 1 to {MOST_JOINTS}"
        raise InvalidInput(message, where=where)
    if not np.isfinite(place).all():
        raise InvalidInput("the root holds NaN or infinite numbers", where=where)
    off = np.abs(np.linalg.norm(turns, axis=1) - 1.0)
    if not (off <= OFF_UNIT).all():
        raise InvalidInput(f"the rotation of joint {int(np.argmax(~(off <= OFF_UNIT)))} has not length 1", where=where)
    return place, turns
