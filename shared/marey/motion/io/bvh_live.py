"""A BVH file that is valid at every moment while its motion is being generated, even if the process is killed.

- The file is created with its first frame, by a rename: BVH cannot express "no frames".
- A row is written before it is counted, so `Frames:` never counts missing rows. Between the two steps the file has more
  rows than it says: three.js stops at the count, Blender and `bvh.py` read all rows. The count has a fixed width,
  padded with blanks, and is written in place.
- A row is never partial: Blender and `bvh.py` would refuse the file. A write of a killed process ends at a border of a
  memory page, so a row that would cross such a border begins behind it, after blanks. (This holds for rows of up to a
  page, about a hundred joints, and not after a power failure: only `close` waits for the disk.)

The numbers are those of `bvh_write.py`, which writes whole clips.
"""

from __future__ import annotations

import errno
import math
import os
import tempfile
from io import FileIO
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from marey.core.errors import Conflict, InvalidInput, TooLarge
from marey.motion.files import write_atomically
from marey.motion.io.bvh import MAX_FRAMES
from marey.motion.io.bvh_write import Layout
from marey.motion.rotations import Array, continuous_euler, slerp
from marey.motion.skeleton import Skeleton

PAGE = 4096  # bytes; larger pages of some systems have borders at multiples of it
COUNT_WIDTH = len(str(MAX_FRAMES))


class LiveBVH:
    """A BVH file that grows frame by frame: centimetres, Y up, one row per frame. Not thread-safe.

    Args:
        path: the file; it does not exist before the first frame.
        skeleton: its offsets become the OFFSETs.
        fps: frames a second.

    Attributes:
        frames: rows in the file.
        filled: number of rows interpolated for missing frames.
    """

    def __init__(self, path: Path, skeleton: Skeleton, fps: float) -> None:
        if not (math.isfinite(fps) and fps > 0):
            raise InvalidInput(f"{fps:g} frames per second is out of range", where=str(path))
        self.path = path
        self.skeleton = skeleton
        self.fps = fps
        self.frames = 0
        self.filled = 0
        self._layout = Layout(skeleton)
        self._file: FileIO | None = None
        self._closed = False
        self._end = 0  # of the last row, in bytes
        self._count_at = 0
        self._last: tuple[Array, Array, Array] | None = None  # rotations (J, 4), root (3,), angles (J, 3)

    @classmethod
    def open(cls, path: Path | str, skeleton: Skeleton, fps: float, *, overwrite: bool = False) -> LiveBVH:
        """Open a file for writing and check its path now instead of at the first frame.

        Args:
            overwrite: replace an existing file; it stays until the first frame.

        Raises:
            Conflict: the file exists.
            InvalidInput: the folder does not exist or is not writable.
        """
        check_place(path, overwrite=overwrite)
        return cls(Path(path), skeleton, fps)

    def __enter__(self) -> LiveBVH:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def add(self, rotations: ArrayLike, root: ArrayLike, *, missing: int = 0) -> None:
        """Add a frame, and before it the missing frames, so that the timeline stays correct.

        A missing frame is the pose between its neighbours: rotations by slerp, the root by lerp. Missing frames before
        the first one show the first one.

        Args:
            rotations: (J, 4) local unit quaternions `w x y z`.
            root: (3,) metres, Y up.
            missing: number of missing frames before it.

        Raises:
            InvalidInput: wrong shapes, numbers that are not finite, a file that cannot be written or is closed.
            TooLarge: more than `MAX_FRAMES` frames.
        """
        turns, place = self._checked(rotations, root)
        if missing < 0:
            raise InvalidInput(f"{missing} missing frames is out of range", where=str(self.path))
        if self.frames + missing + 1 > MAX_FRAMES:
            raise TooLarge(f"more than {MAX_FRAMES:,} frames", where=str(self.path))
        before = (turns, place) if self._last is None else self._last[:2]
        steps = np.arange(1, missing + 2) / (missing + 1)  # (missing + 1,), the last is the frame itself
        between = slerp(before[0], turns, steps[:-1, None])
        angles = self._layout.angles(np.concatenate([between, turns[None]]))
        if self._last is None:
            angles = continuous_euler(angles)
        else:
            angles = continuous_euler(np.concatenate([self._last[2][None], angles]))[1:]
        places = before[1] + steps[:, None] * (place - before[1])
        self._write(self._layout.rows(places[:, None], angles))
        self._last = turns, place, angles[-1]
        self.frames += missing + 1
        self.filled += missing

    def close(self) -> None:
        """Flush the file to disk. Without a frame no file exists.

        Raises:
            InvalidInput: the disk reports an error.
        """
        self._closed = True
        file, self._file = self._file, None
        if file is None:
            return
        try:
            with file:
                os.fsync(file.fileno())
        except OSError as error:
            raise InvalidInput(f"cannot be written: {error.strerror}", where=str(self.path)) from None

    def _checked(self, rotations: ArrayLike, root: ArrayLike) -> tuple[Array, Array]:
        where = f"{self.path}, frame {self.frames}"
        if self._closed:
            raise InvalidInput("the file is closed", where=where)
        turns, place = np.asarray(rotations, np.float64), np.asarray(root, np.float64)
        if turns.shape != (len(self.skeleton), 4) or place.shape != (3,):
            message = f"rotations {turns.shape} and root {place.shape}, not ({len(self.skeleton)}, 4) and (3,)"
            raise InvalidInput(message, where=where)
        if not (_finite(turns) and _finite(place)):
            raise InvalidInput("the frame holds NaN or infinite numbers", where=where)
        return turns, place

    def _write(self, rows: list[str]) -> None:
        """Write rows, then the count; all or none. The first row creates the file."""
        kept, count = self._end, self.frames + len(rows)
        try:
            if self._file is None:
                self._file = self._begin(rows.pop(0))
            kept = self._end
            for row in rows:
                self._append(row.encode() + b"\n")
            if rows:
                self._put(self._count_at, f"{count:<{COUNT_WIDTH}}".encode())
        except OSError as error:
            if self._file is not None:
                self._file.truncate(kept)
            self._closed = True
            raise InvalidInput(f"cannot be written: {error.strerror}", where=str(self.path)) from None

    def _begin(self, row: str) -> FileIO:
        blanks = ""
        while True:
            header = self._layout.header(f"{blanks}{1:<{COUNT_WIDTH}}", self.fps).encode() + b"\n"
            self._count_at = header.rindex(b"\nFrames: ") + len("\nFrames: ") + len(blanks)
            over = PAGE - self._count_at % PAGE
            if over >= COUNT_WIDTH:
                break
            blanks = " " * over  # the count must not cross a border either
        data = header + row.encode() + b"\n"
        write_atomically(self.path, data)
        self._end = len(data)
        return FileIO(self.path, "r+")

    def _append(self, row: bytes) -> None:
        room = PAGE - self._end % PAGE
        if room < len(row) <= PAGE:
            row = b" " * room + row
        self._put(self._end, row)
        self._end += len(row)

    def _put(self, at: int, data: bytes) -> None:
        assert self._file is not None
        self._file.seek(at)
        if self._file.write(data) != len(data):  # a part was written
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def check_place(path: Path | str, *, overwrite: bool = False) -> None:
    """Check that a file can be created at this path.

    Raises:
        Conflict: the file exists.
        InvalidInput: the folder does not exist or is not writable.
    """
    path = Path(path)
    if path.is_dir():
        raise InvalidInput("is a folder", where=str(path), hint="Name a file.")
    if path.exists() and not overwrite:
        hint = "Choose another name, or pass overwrite=True."
        raise Conflict("already exists", where=str(path), hint=hint, argument="overwrite")
    try:
        with tempfile.TemporaryFile(dir=path.parent):
            pass
    except OSError as error:
        raise InvalidInput(f"cannot be written: {error.strerror}", where=str(path)) from None


def _finite(values: NDArray[np.floating[Any]]) -> bool:
    return bool(np.isfinite(values).all())
