"""Frames of a live stream as arrays, to and from the bytes that `marey.core.frame_layout` describes."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from marey.core.errors import InvalidInput
from marey.core.frame_layout import HEADER, LAST, MAGIC, MOST_JOINTS, OFF_UNIT, SCALE, VERSION, read_header

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
    header = read_header(data, joints=joints)
    turns = np.frombuffer(data, "<i2", offset=HEADER.size).reshape(header.joints, 4).astype(np.float64) / SCALE
    root, rotations = _checked(header.root, turns, f"frame {header.number}")
    unit = (rotations / np.linalg.norm(rotations, axis=1, keepdims=True)).astype(np.float32)
    return Frame(header.number, root, unit, header.contacts, header.prompt, header.last)


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
