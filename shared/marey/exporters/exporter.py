"""Interface of an export format."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Generic, TypeVar

if TYPE_CHECKING:
    from marey.motion.clip import MotionClip
    from marey.motion.rest_pose import RestPose
    from marey.motion.units import Unit, Up

Decoded = TypeVar("Decoded")
"""The result of `Exporter.decode`: a `MotionClip`, or a `BvhClip` for files that leave open how the body faces."""
_FORMAT = re.compile(r"[a-z0-9]{1,16}")
_EXTENSION = re.compile(r"[a-z0-9]{1,9}")
"""Names of files leave room for nine characters (`marey.client.names.MAX_BYTES`)."""


@dataclass(frozen=True)
class Coordinates:
    """Unit of length, upward axis and rest pose of a file whose format leaves them open, such as BVH; other formats
    ignore them."""

    unit: Unit = "cm"
    up: Up = "y"
    rest_pose: RestPose = "t"


@dataclass(frozen=True)
class Exporter(Generic[Decoded]):
    """A file format that motions are written in.

    Attributes:
        format: its name in routes, in the database and after `--format`: `[a-z0-9]{1,16}`. It never changes.
        media_type: the `Content-Type` of downloads.
        extension: the ending of file names, without the dot.
        holds_prompt: files hold the clip's manifest, which has the prompt. When a prompt is erased, stored files are
            decoded and encoded again with the remaining manifest; such a format needs a `decode` that returns a
            `MotionClip` with the manifest.
        encode: write a clip, or a result of `decode`. Equal clips give equal bytes: files are stored under their
            sha256.
        decode: read the bytes of a file; the second argument names it in errors. None for a format that is only
            written. Raises `InvalidFile` if the file is broken or of another format.
    """

    format: str
    media_type: str
    extension: str
    holds_prompt: bool
    encode: Callable[[MotionClip | Decoded, Coordinates], bytes]
    decode: Callable[[bytes, str, Coordinates], Decoded] | None = None

    def __post_init__(self) -> None:
        """Check the names.

        Raises:
            ValueError: a name does not fit into routes and file names, or erasure could not rewrite the files.
        """
        for value, pattern in ((self.format, _FORMAT), (self.extension, _EXTENSION)):
            if not pattern.fullmatch(value):
                raise ValueError(f"{value!r} does not match {pattern.pattern}")
        if self.holds_prompt and self.decode is None:
            raise ValueError(f"{self.format} holds prompts, so it needs `decode`: erasure rewrites its files")
