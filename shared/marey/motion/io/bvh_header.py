"""The part of a BVH file before its numbers: the tree of joints, the channels, the rate."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from marey.core.errors import InvalidFile, TooLarge

MAX_JOINTS = 512  # a rig with face and fingers has about 300
LARGEST = 1e9  # limit of any number, degrees or millimetres
MAX_HEADER, MAX_LINE = 2**21, 2**16
"""Bytes before the numbers, and of a line there: four kilobytes a joint, and 256 joints in a line."""


@dataclass
class Joint:
    """A joint while its file is being read; `channels` are (kind, axis), kind `p` or `r`."""

    name: str
    parent: int
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    end: tuple[float, float, float] | None = None
    channels: list[tuple[str, str]] = field(default_factory=list[tuple[str, str]])
    first: int = 0


class BvhHeader:
    """The part of the file before the numbers."""

    def __init__(self, data: bytes, where: str) -> None:
        self.where = where
        self.joints: list[Joint] = []
        self.notes: list[str] = []
        self.channels = 0
        self.motion_line = 0  # line number of the first line of numbers
        self.motion_at = 0  # its first byte
        self.line = 1
        self._read(data)

    def fail(self, message: str, *, line: int | None = None, hint: str | None = None) -> InvalidFile:
        return InvalidFile(message, where=f"{self.where}, line {line or self.line}", hint=hint)

    def _lines(self, data: bytes) -> Iterator[tuple[str, int]]:
        """Lines without their ends, and the position of the next one; ends may be LF, CRLF or CR."""
        at = 3 if data.startswith(b"\xef\xbb\xbf") else 0
        alone = b"\n" not in data[: 2**16]
        while at < len(data):
            end = data.find(b"\r" if alone else b"\n", at)
            end = len(data) if end < 0 else end
            if end - at > MAX_LINE or end > MAX_HEADER:
                limit = f"a line of over {MAX_LINE:,}" if end - at > MAX_LINE else f"over {MAX_HEADER:,}"
                raise TooLarge(f"has {limit} bytes before its numbers", where=f"{self.where}, line {self.line}")
            raw, at = data[at:end], end + 1
            try:
                yield raw.decode("utf-8").strip(), at
            except UnicodeDecodeError:
                yield raw.decode("latin-1").strip(), at
            self.line += 1

    def _read(self, data: bytes) -> None:
        if b"\0" in data[:4096]:
            raise self.fail("is not text", line=1, hint="A BVH file begins with the word HIERARCHY.")
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
                time = self._number(" ".join(value.split()[1:]))
                if not 1e-4 <= time <= 10:
                    raise self.fail(f"a frame time of {time:g} seconds is invalid")
                self.fps = rate(time)
                self.motion_line, self.motion_at = self.line + 1, at
                break
            else:
                raise self.fail(f"expected `Frames:` or `Frame Time:`, found `{text[:40]}`")
        else:
            raise self.fail("ends before `Frame Time:`", hint="The file is cut off, or has no motion.")
        if frames is None:
            raise self.fail("`Frames:` is missing before `Frame Time:`")
        if not 0 <= frames < 2**53 or frames != int(frames):
            raise self.fail(f"{frames:g} is not a number of frames", line=self.frames_line)
        self.frames = int(frames)

    def _number(self, text: str) -> float:
        try:
            number = float(text)
        except ValueError:
            raise self.fail(f"`{text[:40]}` is not a number") from None
        if not abs(number) <= LARGEST:
            raise self.fail(f"`{text[:40]}` is not finite, or far too large")
        return number

    def _hierarchy(self, lines: Iterator[tuple[str, int]]) -> None:
        """HIERARCHY down to MOTION. A stack of open braces: joint index, or -1 for an End Site."""
        stack: list[int] = []
        opening: int | None = None  # owner of the next opening brace
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
        """Parse ROOT, JOINT, End Site, OFFSET or CHANNELS; return the owner of its brace."""
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
            self.joints.append(Joint(name, stack[-1] if stack else -1))
            return len(self.joints) - 1
        if not stack:
            raise self.fail(f"`{key[:40]}` outside of any joint")
        if key == "END":
            brace = words.index("{") if "{" in words else len(words)
            del words[:brace]  # `Site`, and in some files a name
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
        raise self.fail(f"`{key[:40]}` is not a BVH keyword")

    def _channels(self, words: list[str], joint: Joint | None) -> None:
        count = self._number(words.pop(0) if words else "")
        if joint is None or joint.channels:
            raise self.fail("CHANNELS of an End Site" if joint is None else f"CHANNELS of {joint.name} a second time")
        if not 0 <= count <= 6 or count != int(count):
            raise self.fail(f"{count:g} channels; allowed: 0 to 6")
        if len(words) < count:
            raise self.fail(f"{count:g} channels are declared, but {len(words)} named")
        for _ in range(int(count)):
            word = words.pop(0)
            axis, kind = word[:1].upper(), word[1:].lower()
            if axis not in tuple("XYZ") or kind not in ("position", "rotation"):
                raise self.fail(f"`{word[:40]}` is not a channel", hint="Channels are Xposition … Zrotation.")
            if (kind[0], axis) in joint.channels and kind == "position":
                raise self.fail(f"{word} is named twice")
            joint.channels.append((kind[0], axis))
        joint.first = self.channels
        self.channels += int(count)


def rate(frame_time: float) -> float:
    """Frames a second. 0.0333333 is 30 and 0.0417083 is 24000 / 1001: the rate it was rounded from."""
    fps = 1 / frame_time
    for rate in (float(round(fps)), round(fps * 1.001) / 1.001):
        if rate and abs(fps - rate) < 2e-4 * rate:
            return rate
    return fps
