"""Read and write BVH files.

Reading accepts files of other programs: six channels a joint, positions that replace the OFFSET or are added to it,
any rotation order, tabs, CRLF, wrong frame counts, a T-pose before the first frame. Oddities without consequence are
listed in `BvhClip.notes`; broken files raise InvalidFile with a line number.
"""

from __future__ import annotations

import warnings
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np

from marey.core.errors import InvalidFile, TooLarge
from marey.motion.files import read_limited
from marey.motion.io.bvh_header import LARGEST, BvhHeader, Joint
from marey.motion.io.bvh_write import format_bvh, write_bvh
from marey.motion.kinematics import forward_kinematics
from marey.motion.rotations import AXES, Z_TO_Y, Array, angle_between, from_euler, multiply, rotate, unroll
from marey.motion.skeleton import Skeleton, distinct_names, mirror_by_name
from marey.motion.units import METRES, Unit, Up

__all__ = ["MAX_BYTES", "MAX_FRAMES", "BvhClip", "format_bvh", "parse_bvh", "read_bvh", "write_bvh"]

MAX_BYTES = 512 * 2**20  # the longest known capture takes are under 100 MB
MAX_FRAMES = 1_000_000  # over two hours at 120 fps
WIDEST = 32
"""Bytes of a number with the blanks around it, where only the first frames are read."""


@dataclass(frozen=True, eq=False)
class BvhClip:
    """The content of a BVH file in metres, Y up.

    Attributes:
        skeleton: its own tree; offsets are the file's (or the constant positions that replace them), root offset zero.
        rotations: (T, J, 4) float64 local quaternions.
        root: (T, 3) float64 position of joint 0.
        positions: (T, J, 3) local translations in place of the offsets, when a joint under the root moves; else None.
        fps: frames a second; a rounded frame time is converted back to the rate it was rounded from.
        ends: (J, 3) offset of the End Site, NaN where there is none.
        rest: the first frame's joints (J, 3), if it was a rest pose and has been left out.
        notes: oddities of the file, as sentences.
    """

    skeleton: Skeleton
    rotations: Array = field(repr=False)
    root: Array = field(repr=False)
    positions: Array | None = field(repr=False)
    fps: float
    ends: Array = field(repr=False)
    rest: Array | None = field(default=None, repr=False)
    notes: tuple[str, ...] = ()

    def joints(self) -> Array:
        """(T, J, 3) joint positions in the world, metres."""
        return forward_kinematics(self.skeleton, self.rotations, self.root, positions=self.positions)


def read_bvh(
    path: Path | str,
    *,
    unit: Unit = "cm",
    up: Up = "y",
    rest_frame: Literal["auto", "keep", "drop"] = "auto",
    translation: Literal["auto", "replace", "add"] = "auto",
) -> BvhClip:
    """Read a BVH file.

    Args:
        path: the file.
        unit: unit of its lengths.
        up: the axis of the file that points up.
        rest_frame: drop the first frame if it is a rest pose (`auto`: if it differs clearly from the motion).
        translation: position channels replace the OFFSET (Blender) or are added to it (three.js, iClone);
            `auto` detects it.

    Raises:
        NotFound: no such file.
        InvalidFile: broken, with the line number.
        TooLarge: over `MAX_BYTES`, `MAX_FRAMES` or the limit of joints.
    """
    path = Path(path)
    data = read_limited(path, MAX_BYTES)
    return parse_bvh(data, str(path), unit=unit, up=up, rest_frame=rest_frame, translation=translation)


def parse_bvh(
    data: bytes,
    where: str = "bvh",
    *,
    unit: Unit = "cm",
    up: Up = "y",
    rest_frame: Literal["auto", "keep", "drop"] = "auto",
    translation: Literal["auto", "replace", "add"] = "auto",
    frames: int | None = None,
) -> BvhClip:
    """Read the bytes of a BVH file; see `read_bvh`. `where` names it in errors.

    Args:
        frames: read only so many of the first frames; what follows is not looked at.
    """
    if len(data) > MAX_BYTES:
        message = f"{len(data) / 2**20:.0f} MiB, over the limit of {MAX_BYTES / 2**20:.0f} MiB"
        raise TooLarge(message, where=where)
    header = BvhHeader(data, where)
    values = _numbers(data, header, where, frames)
    joints, notes = header.joints, header.notes
    if header.frames != len(values) and frames is None:
        notes.append(f"line {header.frames_line}: the header says {header.frames} frames, the file holds {len(values)}")
    given = [j.name for j in joints]
    notes += [f"there are several joints {name}" for name, count in Counter(given).items() if count > 1]
    names = distinct_names(given)
    rotations = _rotations(joints, values)
    offsets, channels, given = _translations(joints, values)
    tree = Skeleton("bvh", names, tuple(j.parent for j in joints), offsets.astype(np.float32), mirror_by_name(names))
    add = _are_added(tree, rotations, channels, given, up) if translation == "auto" else translation == "add"
    if add:
        notes.append("positions are added to the OFFSETs")
    moving = np.where(given, channels + offsets * add, offsets)
    ends = np.array([j.end or (np.nan,) * 3 for j in joints])
    offsets, moving, ends = (lengths * METRES[unit] for lengths in (offsets, moving, ends))
    if up == "z":
        offsets, moving, ends = (rotate(Z_TO_Y, a) for a in (offsets, moving, ends))
        rotations = multiply(multiply(Z_TO_Y, rotations), Z_TO_Y * [1, -1, -1, -1])
    clip = _clip(tree, rotations, offsets, moving, header.fps, ends, notes)
    drop = rest_frame == "drop" or (rest_frame == "auto" and first_frame_stands_apart(clip))
    return _without_first(clip) if drop and len(values) > 1 else clip


def _clip(
    tree: Skeleton, rotations: Array, offsets: Array, moving: Array, fps: float, ends: Array, notes: list[str]
) -> BvhClip:
    """Return the clip of a file in metres, Y up: with translations (T, J, 3) only if they are not constant."""
    still = np.ptp(moving[:, 1:], axis=0).max(initial=0.0) < 1e-4  # metres: the rounding of a file
    offsets = np.concatenate([np.zeros((1, 3)), moving[:, 1:].mean(axis=0) if still else offsets[1:]])
    skeleton, positions = tree.with_offsets(offsets), None if still else moving
    return BvhClip(skeleton, unroll(rotations), moving[:, 0], positions, fps, ends, None, tuple(notes))


def _rotations(joints: list[Joint], values: Array) -> Array:
    """Return local rotations (T, J, 4) of the motion's numbers (T, C); joints of one rotation order are converted
    together."""
    rotations = np.empty((len(values), len(joints), 4))
    by_order: dict[str, list[int]] = {}
    for j, joint in enumerate(joints):
        by_order.setdefault("".join(a for kind, a in joint.channels if kind == "r"), []).append(j)
    for order, members in by_order.items():
        columns = [[joints[j].first + c for c, (k, _) in enumerate(joints[j].channels) if k == "r"] for j in members]
        rotations[:, members] = from_euler(values[:, np.array(columns, np.intp).reshape(len(members), -1)], order)
    return rotations


def first_frame_stands_apart(clip: BvhClip) -> bool:
    """Return True if the first frame is a rest pose: the joints turn far more between frames 0 and 1 than anywhere
    later."""
    if len(clip.rotations) < 4:
        return False
    steps = angle_between(clip.rotations[:-1], clip.rotations[1:]).mean(axis=1)
    return bool(steps[0] > 0.1 and steps[0] > 3 * steps[1:].max())


def _without_first(clip: BvhClip) -> BvhClip:
    positions = None if clip.positions is None else clip.positions[1:]
    return BvhClip(
        clip.skeleton, clip.rotations[1:], clip.root[1:], positions, clip.fps, clip.ends, clip.joints()[0], clip.notes
    )


def _translations(joints: list[Joint], values: Array) -> tuple[Array, Array, Array]:
    """Return offsets (J, 3), the position channels (T, J, 3) and a mask of existing channels (J, 3), in the file's
    unit."""
    offsets = np.array([j.offset for j in joints], np.float64)
    channels = np.zeros((len(values), *offsets.shape))
    given = np.zeros(offsets.shape, bool)
    for j, joint in enumerate(joints):
        for column, (kind, axis) in enumerate(joint.channels, start=joint.first):
            if kind == "p":
                channels[:, j, AXES.index(axis)] = values[:, column]
                given[j, AXES.index(axis)] = True
    return offsets, channels, given


def _are_added(tree: Skeleton, rotations: Array, channels: Array, given: Array, up: Up) -> bool:
    """Return True if position channels are added to the OFFSETs (three.js, iClone), False if they replace them
    (Blender, Bandai-Namco).

    Joints below the root decide it: where channels replace, they hold the offset. In a file with channels on the root
    alone, it is the reading whose lowest point is nearer to the floor.
    """
    offsets = tree.offsets.astype(np.float64)
    lengths = np.linalg.norm(offsets, axis=-1)
    tell = given.all(axis=-1) & (lengths > 0)
    if tell[1:].any():
        moved = np.linalg.norm(np.median(channels, axis=0) - offsets, axis=-1)
        return float(np.median((moved / np.maximum(lengths, 1e-12))[1:][tell[1:]])) > 0.5
    axis = 1 if up == "y" else 2
    if not given[0, axis] or offsets[0, axis] == 0:
        return False
    some = slice(None, None, max(1, len(rotations) // 64))
    lowest = float(forward_kinematics(tree, rotations[some], channels[some, 0])[..., axis].min())
    return abs(lowest + float(offsets[0, axis])) < abs(lowest)


def _numbers(data: bytes, header: BvhHeader, where: str, frames: int | None) -> Array:
    """Parse the motion (T, C). The fast path reads all at once; a broken file is read again line by line, for the
    message."""
    width = header.channels
    if not width:
        raise header.fail("no joint has channels: there is no motion")
    motion = data[header.motion_at :] if frames is None else _first_frames(data, header, frames)
    with warnings.catch_warnings():
        # Up to numpy 2.2 text that is not a number is a DeprecationWarning and an early end, later a ValueError.
        warnings.simplefilter("error", DeprecationWarning)
        try:
            values = np.fromstring(motion, np.float64, sep=" ")
        except (DeprecationWarning, ValueError):
            values = None
    if values is None or not (np.abs(values) <= LARGEST).all() or not _lines_hold_frames(motion, width):
        raise _first_fault(motion, header, where)
    if values.size // width > MAX_FRAMES:
        raise TooLarge(f"{values.size // width} frames, over the limit of {MAX_FRAMES}", where=where)
    if not values.size:
        raise header.fail("holds no frames")
    return values.reshape(-1, width)[:frames]


def _first_frames(data: bytes, header: BvhHeader, frames: int) -> bytes:
    """Return the text of at least so many frames if there are as many; it ends where a frame does."""
    width, wanted = header.channels, frames * header.channels
    head = data[header.motion_at : header.motion_at + wanted * WIDEST]
    if header.motion_at + len(head) == len(data):
        return head
    numbers = size = whole = 0
    for line in head.splitlines(keepends=True)[:-1]:  # the last may be cut
        numbers, size = numbers + len(line.split()), size + len(line)
        if numbers % width == 0:
            whole = size
            if numbers >= wanted:
                break
    if whole:
        return head[: size if numbers > wanted else whole]  # beyond without an end of a frame: a fault is between
    words = head.split()[:-1]  # a line of many frames
    return b" ".join(words[: len(words) // width * width] or words)


def _lines_hold_frames(motion: bytes, width: int) -> bool:
    """Return True if no frame ends and another begins within a line, except on a line of whole frames. A frame may
    take several lines. A number that is missing in one line and too many in the next fails, though the total fits."""
    inside = 0  # numbers of the frame before this line
    for line in motion.splitlines():
        count = len(line.split())
        if inside + count > width and (inside or count % width):
            return False
        inside = (inside + count) % width
    return not inside


def _first_fault(motion: bytes, header: BvhHeader, where: str) -> InvalidFile:
    """Return the error for the first line of numbers that differs from the header."""
    lines = motion.decode("latin-1").splitlines()
    for number, text in enumerate(lines, start=header.motion_line):
        words = text.split()
        for word in words:
            try:
                good = abs(float(word)) <= LARGEST
            except ValueError:
                good = False
            if not good:
                return InvalidFile(
                    f"`{word[:40]}` is not a number, not finite or too large", where=f"{where}, line {number}"
                )
        if words and len(words) != header.channels:
            last = not any(later.strip() for later in lines[number - header.motion_line + 1 :])
            return InvalidFile(
                f"{len(words)} numbers; the channels need {header.channels}",
                where=f"{where}, line {number}",
                hint="The file ends in the middle of a frame: it is cut off." if last else None,
            )
    return InvalidFile("the numbers do not fill whole frames", where=where)
