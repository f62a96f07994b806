"""Frames as they arrive: what the counter wants to know of them, and the file they are written to."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from marey.cli.extras import needs_extra
from marey.core.errors import InvalidInput

if TYPE_CHECKING:
    from marey.motion.io.bvh_live import LiveBVH

HEAD = struct.Struct("<2sBBIHH")
"""The first 12 bytes of a frame, as `marey.streams.frames` has them; that one wants numpy, which a client that
writes no file does without."""


@dataclass(frozen=True)
class Head:
    """Which frame it is, and which prompt was in force."""

    number: int
    prompt: int


def head_of(data: bytes) -> Head:
    """The head of a frame.

    Raises:
        InvalidInput: it is no frame of version 1.
    """
    if len(data) < HEAD.size or data[:3] != b"MF\x01":
        hint = "client and server are of different releases: update the older one"
        raise InvalidInput(f"{len(data)} bytes that are no frame of version 1", where="stream", hint=hint)
    _, _, _, number, _, prompt = HEAD.unpack_from(data)
    return Head(number, prompt)


class Recording:
    """The BVH file that grows with the stream; row n is frame n, also across gaps.

    Args:
        path: the file; it is there from the first frame on.

    Raises:
        InvalidInput: not a `.bvh`, or numpy is not installed.
        Conflict: it is there already.
    """

    def __init__(self, path: Path, *, overwrite: bool) -> None:
        if path.suffix.lower() != ".bvh":
            hint = "--fetch brings the other formats when the stream is over."
            raise InvalidInput("only a .bvh can grow while it is made", where=str(path), hint=hint)
        try:
            from marey.motion.io.bvh_live import check_place
        except ImportError as error:
            raise needs_extra("motion", error) from error
        check_place(path, overwrite=overwrite)
        self._path = path
        self._overwrite = overwrite
        self._file: LiveBVH | None = None

    @property
    def path(self) -> Path | None:
        """The file; None while it has no frame."""
        return self._path.absolute() if self._file is not None and self._file.frames else None

    def add(self, data: bytes, stream: dict[str, Any]) -> None:
        """Write a frame.

        Args:
            data: the frame.
            stream: the stream as the server describes it, with its skeleton.

        Raises:
            MareyError: the frame, the skeleton or the file cannot be used.
        """
        from marey.streams.frames import decode_frame

        if self._file is None:
            self._file = self._open(stream)
        frame = decode_frame(data, joints=len(self._file.skeleton))
        self._file.add(frame.rotations, frame.root, missing=frame.number - self._file.frames)

    def close(self) -> None:
        """Nothing more comes."""
        if self._file is not None:
            self._file.close()

    def _open(self, stream: dict[str, Any]) -> LiveBVH:
        import numpy as np

        from marey.motion.io.bvh_live import LiveBVH
        from marey.motion.skeleton import skeleton_of

        try:
            tree = stream["skeleton"]
            parents = tuple(int(parent) for parent in tree["parents"])
            offsets = np.array(tree["offsets"], np.float32)
            skeleton = skeleton_of(tuple(str(name) for name in tree["names"]), parents, offsets)
            return LiveBVH.open(self._path, skeleton, float(stream["fps"]), overwrite=self._overwrite)
        except (KeyError, TypeError, ValueError) as error:
            raise InvalidInput(
                f"the server describes no skeleton: {error!r}", where=f"stream {stream['id']}"
            ) from error
