"""Interface of an export format."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any, Generic, TypeVar, cast

from marey.motion.export_options import ExportOptions

if TYPE_CHECKING:
    from marey.motion.clip import MotionClip
    from marey.motion.io.bvh import BvhClip
    from marey.motion.rigs.body import RigBody
    from marey.motion.rigs.rigged import RiggedMotion
    from marey.motion.units import Unit, Up

Decoded = TypeVar("Decoded")
"""The result of `Exporter.decode`: a `MotionClip`, or a `BvhClip` for files that leave open how the body faces."""
_FORMAT = re.compile(r"[a-z0-9]{1,16}")
_EXTENSION = re.compile(r"(?=.{1,9}\Z)[a-z0-9]+(\.[a-z0-9]+)?")
"""Names of files leave room for nine characters (`marey.client.names.MAX_BYTES`)."""
EVERYWHERE = frozenset({"body"})
"""Options that act on the motion before it is written, so that every format has them."""
_DEFAULTS: dict[str, Any] = {each.name: each.default for each in fields(ExportOptions)}


@dataclass(frozen=True)
class Coordinates(ExportOptions):
    """Coordinates of a file: unit of length and upward axis where the format does not state them, such as BVH (others
    ignore them), and the options of an export, which a format has by its `Exporter.options`."""

    unit: Unit = "cm"
    up: Up = "y"

    @classmethod
    def of(cls, export: ExportOptions, unit: Unit = "cm", up: Up = "y") -> Coordinates:
        """Return coordinates with these options."""
        return cls(unit, up, **export.values)


@dataclass(frozen=True)
class Exporter(Generic[Decoded]):
    """A file format that motions are written in.

    Attributes:
        format: its name in routes, in the database and after `--format`: `[a-z0-9]{1,16}`. It never changes.
        media_type: the `Content-Type` of downloads.
        extension: the ending of file names, without the dot before it; it may have a part more, such as `smplx.npz`.
        holds_prompt: files hold the clip's manifest, which has the prompt. When a prompt is erased, stored files are
            decoded and encoded again with the remaining manifest; such a format needs a `decode` that returns a
            `MotionClip` with the manifest.
        encode: write a clip, or a result of `decode`. Equal clips give equal bytes: files are stored under their
            sha256.
        stored: workers write it for every motion, and `marey generate` where no format is named; False = it is made on
            request alone, by `generate`, `convert` and `fetch`, because it takes long or can be made at any time.
        options: names of the `ExportOptions` that `encode` heeds; the others of its coordinates have their defaults.
            Those of `EVERYWHERE` are not among them.
        encode_rigged: write a motion that was put on a rig, with the rig's hierarchy, rest pose and joint axes; needed
            for the option `rig`. `root_bone`, `in_place`, `tpose_frame` and `placement` are in the motion already.
        decode: read the bytes of a file; the second argument names it in errors. None for a format that is only
            written. Raises `InvalidFile` if the file is broken or of another format.
        check: raise `InvalidInput` if this process cannot write any file with these options, because an extra is not
            installed or the format needs an option; it is called before motions are made or fetched.
    """

    format: str
    media_type: str
    extension: str
    holds_prompt: bool
    encode: Callable[[MotionClip | Decoded, Coordinates], bytes]
    decode: Callable[[bytes, str, Coordinates], Decoded] | None = None
    options: frozenset[str] = frozenset()
    stored: bool = True
    encode_rigged: Callable[[RiggedMotion, Coordinates], bytes] | None = None
    check: Callable[[ExportOptions], None] | None = None

    def __post_init__(self) -> None:
        """Check the names.

        Raises:
            ValueError: a name does not fit into routes and file names, erasure could not rewrite the files, or an
                option is unknown.
        """
        for value, pattern in ((self.format, _FORMAT), (self.extension, _EXTENSION)):
            if not pattern.fullmatch(value):
                raise ValueError(f"{value!r} does not match {pattern.pattern}")
        if self.holds_prompt and self.decode is None:
            raise ValueError(f"{self.format} holds prompts, so it needs `decode`: erasure rewrites its files")
        if ("rig" in self.options) != (self.encode_rigged is not None):
            raise ValueError(f"{self.format} needs both the option `rig` and `encode_rigged`, or neither")
        if unknown := self.options - _DEFAULTS.keys():
            raise ValueError(f"{self.format} has unknown options: {', '.join(sorted(unknown))}")

    @property
    def heeded(self) -> frozenset[str]:
        """Names of all `ExportOptions` that files of the format heed."""
        return self.options | EVERYWHERE

    def write(self, clip: MotionClip | Decoded, coordinates: Coordinates, rig: RigBody | None = None) -> bytes:
        """Encode a clip with those of the coordinates that the format has.

        Args:
            rig: the rig that the coordinates name as `rig` or as `body`; None = find it
                (`marey.motion.retarget.load.load_body`, `marey.motion.change_body.load_shape`).

        Raises:
            InvalidInput: the clip cannot be written with these options, or put on the rig or the body.
            NotFound, InvalidFile, TooLarge: the file of the rig or of the body cannot be read.
        """
        others = {name: value for name, value in _DEFAULTS.items() if name not in self.options}
        kept = replace(coordinates, **others)
        if coordinates.body is not None:
            clip = _on_body(clip, coordinates.body, coordinates.rig_map, rig)
        if kept.rig is None or self.encode_rigged is None:
            return self.encode(clip, kept)
        from marey.motion.io.convert import as_motion_clip
        from marey.motion.retarget.apply import put_on_rig

        return self.encode_rigged(put_on_rig(as_motion_clip(cast("MotionClip | BvhClip", clip)), kept, rig), kept)


def _on_body(clip: Any, body: str, rig_map: str | None, rig: RigBody | None) -> MotionClip:
    from marey.motion.body_files import body_of_rig
    from marey.motion.change_body import change_body, load_shape
    from marey.motion.io.convert import as_motion_clip
    from marey.motion.skeleton import HUMANML3D

    shape = load_shape(body, rig_map) if rig is None else body_of_rig(rig, HUMANML3D)
    return change_body(as_motion_clip(clip), shape)
