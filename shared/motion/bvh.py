"""BVH files: read what anybody wrote, write what everybody reads.

Reading is for files nobody here wrote: six channels a joint, positions that replace the OFFSET or are added to it,
any rotation order, tabs, CRLF, wrong frame counts, a T-pose before the first frame. What is odd but harmless is told in
`BvhClip.notes`; what is broken raises InvalidFile with its line number.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np

from shared.errors import InvalidFile, NotFound, TooLarge
from shared.motion.kinematics import forward_kinematics
from shared.motion.rotations import AXES, Array, angle_between, from_euler, multiply, rotate, unroll
from shared.motion.skeleton import Skeleton, mirror_by_name

MAX_BYTES = 512 * 2**20  # the longest capture takes we know are under 100 MB
MAX_JOINTS = 1024  # a rig with face and fingers has about 300
MAX_FRAMES = 1_000_000  # over two hours at 120 fps

METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": 0.3048}
Unit = Literal["m", "cm", "mm", "in", "ft"]
Up = Literal["y", "z"]
# Z up to Y up: a quarter turn about X
Z_TO_Y = np.array([np.sqrt(0.5), -np.sqrt(0.5), 0.0, 0.0])


@dataclass(frozen=True, eq=False)
class BvhClip:
    """What a BVH file holds, in metres, Y up.

    Attributes:
        skeleton: its own tree; offsets are the file's (or the constant positions that replace them), root offset zero.
        rotations: (T, J, 4) float64 local quaternions.
        root: (T, 3) float64 position of joint 0.
        positions: (T, J, 3) local translations in place of the offsets, when a joint under the root moves; else None.
        fps: frames a second; a rounded frame time is taken back to the rate it was rounded from.
        ends: (J, 3) offset of the End Site, NaN where there is none.
        rest: the first frame's joints (J, 3), if it was a rest pose and has been left out.
        notes: what was odd about the file.
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


@dataclass
class _Joint:
    """A joint while its file is being read; `channels` are (kind, axis), kind `p` or `r`."""

    name: str
    parent: int
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    end: tuple[float, float, float] | None = None
    channels: list[tuple[str, str]] = field(default_factory=list[tuple[str, str]])
    first: int = 0


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
        unit: what its lengths are in.
        up: which axis of the file points up.
        rest_frame: leave the first frame out when it is a rest pose (`auto`: when it stands apart from the rest).
        translation: whether position channels replace the OFFSET (Blender) or are added to it (three.js, iClone);
            `auto` finds out.

    Raises:
        NotFound: no such file.
        InvalidFile: broken, with the line number.
        TooLarge: over the limits above.
    """
    path = Path(path)
    try:
        size = path.stat().st_size
        if size > MAX_BYTES:
            raise TooLarge(f"{size / 2**20:.0f} MiB, over the limit of {MAX_BYTES / 2**20:.0f} MiB", where=str(path))
        data = path.read_bytes()
    except FileNotFoundError:
        raise NotFound("no such file", where=str(path)) from None
    except OSError as error:
        raise InvalidFile(f"cannot be read: {error.strerror}", where=str(path)) from None
    return parse_bvh(data, str(path), unit=unit, up=up, rest_frame=rest_frame, translation=translation)


def parse_bvh(
    data: bytes,
    where: str = "bvh",
    *,
    unit: Unit = "cm",
    up: Up = "y",
    rest_frame: Literal["auto", "keep", "drop"] = "auto",
    translation: Literal["auto", "replace", "add"] = "auto",
) -> BvhClip:
    """Read the bytes of a BVH file; see `read_bvh`. `where` names it in errors."""
    header = _Header(data, where)
    notes = header.notes
    values = _numbers(data, header, where)
    joints, scale = header.joints, METRES[unit]
    frames = len(values)
    if header.frames != frames:
        notes.append(f"line {header.frames_line}: the header says {header.frames} frames, the file holds {frames}")
    rotations = np.empty((frames, len(joints), 4))
    by_order: dict[str, list[int]] = {}
    for j, joint in enumerate(joints):
        by_order.setdefault("".join(a for kind, a in joint.channels if kind == "r"), []).append(j)
    for order, members in by_order.items():
        columns = [[joints[j].first + c for c, (k, _) in enumerate(joints[j].channels) if k == "r"] for j in members]
        rotations[:, members] = from_euler(values[:, np.array(columns, np.intp).reshape(len(members), -1)], order)
    names = _unique([j.name for j in joints], notes)
    offsets, channels, given = _translations(joints, values)
    tree = Skeleton("bvh", names, tuple(j.parent for j in joints), offsets.astype(np.float32), mirror_by_name(names))
    add = _are_added(tree, rotations, channels, given, up) if translation == "auto" else translation == "add"
    if add:
        notes.append("positions are added to the OFFSETs")
    moving = np.where(given, channels + offsets * add, offsets) * scale
    offsets, root = offsets * scale, moving[:, 0]
    ends = np.array([j.end or (np.nan,) * 3 for j in joints]) * scale
    if up == "z":
        offsets, moving, root, ends = (rotate(Z_TO_Y, a) for a in (offsets, moving, root, ends))
        rotations = multiply(multiply(Z_TO_Y, rotations), Z_TO_Y * [1, -1, -1, -1])
    still = np.ptp(moving[:, 1:], axis=0).max(initial=0.0) < 1e-4  # metres: what rounding in a file can do
    offsets = np.concatenate([np.zeros((1, 3)), moving[:, 1:].mean(axis=0) if still else offsets[1:]])
    skeleton = tree.with_offsets(offsets)
    clip = BvhClip(skeleton, unroll(rotations), root, None if still else moving, header.fps, ends, None, tuple(notes))
    drop = rest_frame == "drop" or (rest_frame == "auto" and first_frame_stands_apart(clip))
    return _without_first(clip) if drop and frames > 1 else clip


def first_frame_stands_apart(clip: BvhClip) -> bool:
    """Whether the first frame is a rest pose and no part of the motion: the joints turn far more from it to the second
    frame than they ever do within the motion."""
    if len(clip.rotations) < 4:
        return False
    steps = angle_between(clip.rotations[:-1], clip.rotations[1:]).mean(axis=1)
    return bool(steps[0] > 0.1 and steps[0] > 3 * steps[1:].max())


def _without_first(clip: BvhClip) -> BvhClip:
    positions = None if clip.positions is None else clip.positions[1:]
    return BvhClip(
        clip.skeleton, clip.rotations[1:], clip.root[1:], positions, clip.fps, clip.ends, clip.joints()[0], clip.notes
    )


def _translations(joints: list[_Joint], values: Array) -> tuple[Array, Array, Array]:
    """Offsets (J, 3), the position channels (T, J, 3) and which there are (J, 3), in the file's unit."""
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
    """Whether position channels are added to the OFFSETs (three.js, iClone) or replace them (Blender, Bandai-Namco).

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


def _unique(names: list[str], notes: list[str]) -> tuple[str, ...]:
    seen: dict[str, int] = {}
    unique: list[str] = []
    for name in names:
        seen[name] = seen.get(name, 0) + 1
        if seen[name] > 1:
            notes.append(f"there are several joints {name}")
        unique.append(name if seen[name] == 1 else f"{name}.{seen[name]}")
    return tuple(unique)


class _Header:
    """Everything before the numbers."""

    def __init__(self, data: bytes, where: str) -> None:
        self.where = where
        self.joints: list[_Joint] = []
        self.notes: list[str] = []
        self.channels = 0
        self.motion_line = 0  # line number of the first line of numbers
        self.motion_at = 0  # its first byte
        self.line = 1
        self._read(data)

    def fail(self, message: str, *, line: int | None = None, hint: str | None = None) -> InvalidFile:
        return InvalidFile(message, where=f"{self.where}, line {line or self.line}", hint=hint)

    def _lines(self, data: bytes) -> Iterator[tuple[str, int]]:
        """Lines without their ends, and where the next begins; ends may be LF, CRLF or CR."""
        at = 3 if data.startswith(b"\xef\xbb\xbf") else 0
        alone = b"\n" not in data[: 2**16]
        while at < len(data):
            end = data.find(b"\r" if alone else b"\n", at)
            end = len(data) if end < 0 else end
            raw, at = data[at:end], end + 1
            try:
                yield raw.decode("utf-8").strip(), at
            except UnicodeDecodeError:
                yield raw.decode("latin-1").strip(), at
            self.line += 1

    def _read(self, data: bytes) -> None:
        if b"\0" in data[:4096]:
            raise self.fail("is no text", line=1, hint="A BVH file begins with the word HIERARCHY.")
        lines = self._lines(data)
        self._hierarchy(lines)
        frames: float | None = None
        for text, at in lines:
            if not text:
                continue
            key, _, value = text.replace(":", " ").replace("\t", " ").lower().partition(" ")
            if key == "frames" and frames is None:
                frames, self.frames_line = self._number(value), self.line
            elif key == "frame" and value.split()[:1] == ["time"]:
                time = self._number(value.split(None, 1)[1] if " " in value else "")
                if not 1e-4 <= time <= 10:
                    raise self.fail(f"a frame time of {time:g} seconds cannot be")
                self.fps = _rate(time)
                self.motion_line, self.motion_at = self.line + 1, at
                break
            else:
                raise self.fail(f"expected `Frames:` or `Frame Time:`, found `{text[:40]}`")
        else:
            raise self.fail("ends before `Frame Time:`", hint="The file is cut off, or has no motion.")
        if frames is None:
            raise self.fail("`Frames:` is missing before `Frame Time:`")
        if not 0 <= frames < 2**53 or frames != int(frames):
            raise self.fail(f"{frames:g} is no number of frames", line=self.frames_line)
        self.frames = int(frames)

    def _number(self, text: str) -> float:
        try:
            number = float(text)
        except ValueError:
            raise self.fail(f"`{text[:40]}` is no number") from None
        if not np.isfinite(number):
            raise self.fail(f"`{text[:40]}` is not finite")
        return number

    def _hierarchy(self, lines: Iterator[tuple[str, int]]) -> None:
        """HIERARCHY down to MOTION. A stack of open braces: joint index, or -1 for an End Site."""
        stack: list[int] = []
        opening: int | None = None  # what the next brace opens
        begun = False
        for text, _ in lines:
            words = text.replace("{", " { ").replace("}", " } ").split()
            while words:
                word = words.pop(0)
                key = word.upper()
                if not begun:
                    if key != "HIERARCHY":
                        raise self.fail(
                            f"expected HIERARCHY, found `{word[:40]}`",
                            hint="A BVH file begins with the word HIERARCHY.",
                        )
                    begun = True
                elif key == "{":
                    if opening is None:
                        raise self.fail("a brace opens after neither a joint nor an End Site")
                    stack.append(opening)
                    opening = None
                elif opening is not None:
                    raise self.fail(f"expected an opening brace, found `{word[:40]}`")
                elif key == "}":
                    if not stack:
                        raise self.fail("a brace closes that was never opened")
                    stack.pop()
                elif key == "MOTION":
                    if stack:
                        raise self.fail(f"MOTION before {len(stack)} braces are closed")
                    if not self.joints:
                        raise self.fail("MOTION before any joint")
                    return
                else:
                    opening = self._statement(key, words, stack)
        raise self.fail("ends before MOTION", hint="The file is cut off.")

    def _statement(self, key: str, words: list[str], stack: list[int]) -> int | None:
        """ROOT, JOINT, End Site, OFFSET or CHANNELS; returns what its brace opens."""
        if key in ("ROOT", "JOINT"):
            if (key == "ROOT") != (not stack):
                raise self.fail("JOINT outside of any joint" if key == "JOINT" else "ROOT inside of a joint")
            if key == "ROOT" and self.joints:
                raise self.fail("a second ROOT", hint="Split the file: one skeleton a file.")
            if stack and stack[-1] < 0:
                raise self.fail("a joint inside of an End Site")
            brace = words.index("{") if "{" in words else len(words)
            name = " ".join(words[:brace]) or f"joint{len(self.joints)}"
            del words[:brace]
            if len(self.joints) >= MAX_JOINTS:
                raise TooLarge(f"more than {MAX_JOINTS} joints", where=f"{self.where}, line {self.line}")
            self.joints.append(_Joint(name, stack[-1] if stack else -1))
            return len(self.joints) - 1
        if not stack:
            raise self.fail(f"`{key[:40]}` outside of any joint")
        if key == "END":
            brace = words.index("{") if "{" in words else len(words)
            del words[:brace]  # `Site`, and now and then a name
            return -1
        if key == "OFFSET":
            if len(words) < 3:
                raise self.fail("OFFSET needs three numbers")
            x, y, z = (self._number(words.pop(0)) for _ in range(3))
            if stack[-1] >= 0:
                self.joints[stack[-1]].offset = (x, y, z)
            elif len(stack) > 1:
                self.joints[stack[-2]].end = (x, y, z)
            return None
        if key == "CHANNELS":
            self._channels(words, self.joints[stack[-1]] if stack[-1] >= 0 else None)
            return None
        raise self.fail(f"`{key[:40]}` is no word of BVH")

    def _channels(self, words: list[str], joint: _Joint | None) -> None:
        count = self._number(words.pop(0) if words else "")
        if joint is None or joint.channels:
            raise self.fail("CHANNELS of an End Site" if joint is None else f"CHANNELS of {joint.name} a second time")
        if not 0 <= count <= 6 or count != int(count):
            raise self.fail(f"{count:g} channels; 0 to 6 can be")
        if len(words) < count:
            raise self.fail(f"{count:g} channels are announced, {len(words)} named")
        for _ in range(int(count)):
            word = words.pop(0)
            axis, kind = word[:1].upper(), word[1:].lower()
            if axis not in tuple("XYZ") or kind not in ("position", "rotation"):
                raise self.fail(f"`{word[:40]}` is no channel", hint="Channels are Xposition … Zrotation.")
            if (kind[0], axis) in joint.channels and kind == "position":
                raise self.fail(f"{word} is named twice")
            joint.channels.append((kind[0], axis))
        joint.first = self.channels
        self.channels += int(count)


def _rate(frame_time: float) -> float:
    """Frames a second. 0.0333333 is 30 and 0.0417083 is 24000 / 1001: the rate it was rounded from."""
    fps = 1 / frame_time
    for rate in (float(round(fps)), round(fps * 1.001) / 1.001):
        if rate and abs(fps - rate) < 2e-4 * rate:
            return rate
    return fps


def _numbers(data: bytes, header: _Header, where: str) -> Array:
    """The motion (T, C). Fast where all is well; only a broken file is read again line by line, to say where."""
    with warnings.catch_warnings():
        # Up to numpy 2.2 text that is no number is a DeprecationWarning and an early end, later a ValueError.
        warnings.simplefilter("error", DeprecationWarning)
        try:
            values = np.fromstring(data[header.motion_at :], np.float64, sep=" ")
        except (DeprecationWarning, ValueError):
            values = None
    width = header.channels
    if not width:
        raise header.fail("no joint has channels: there is no motion")
    if values is None or values.size % width or not np.isfinite(values).all():
        raise _first_fault(data, header, where)
    if values.size // width > MAX_FRAMES:
        raise TooLarge(f"{values.size // width} frames, over the limit of {MAX_FRAMES}", where=where)
    if not values.size:
        raise header.fail("holds no frames")
    return values.reshape(-1, width)


def _first_fault(data: bytes, header: _Header, where: str) -> InvalidFile:
    """The error for the first line of numbers that is not what the header promised."""
    lines = data[header.motion_at :].decode("latin-1").splitlines()
    for number, text in enumerate(lines, start=header.motion_line):
        words = text.split()
        for word in words:
            try:
                good = bool(np.isfinite(float(word)))
            except ValueError:
                good = False
            if not good:
                return InvalidFile(f"`{word[:40]}` is no finite number", where=f"{where}, line {number}")
        if words and len(words) != header.channels:
            last = not any(later.strip() for later in lines[number - header.motion_line + 1 :])
            return InvalidFile(
                f"{len(words)} numbers, where the channels need {header.channels}",
                where=f"{where}, line {number}",
                hint="The file ends in the middle of a frame: it is cut off." if last else None,
            )
    return InvalidFile("the numbers do not fill whole frames", where=where)
