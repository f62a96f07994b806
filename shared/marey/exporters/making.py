"""Files made of a stored npz: another format, another rate, or options. Importing this needs the standard library
only."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any

from marey.core.errors import InvalidInput
from marey.core.extras import extra
from marey.exporters.exporter import Coordinates
from marey.exporters.registry import CANONICAL, exporter_of, exporters, version_of
from marey.motion.export_options import PLAIN, ExportOptions

if TYPE_CHECKING:
    from marey.motion.rigs.body import RigBody


@dataclass(frozen=True)
class RigFile:
    """A rig whose file comes with the npz.

    Attributes:
        format: ending of the file's name.
        sha256: of the file.
        map: JSON value of the map of its joints; None = no map.
    """

    name: str
    format: str
    sha256: str
    map: Any = None

    def body(self, data: bytes) -> RigBody:
        """Return the rig of the file's bytes.

        Raises:
            InvalidInput, InvalidFile, TooLarge: they cannot be read, or motion cannot be put on it.
        """
        from marey.motion.retarget.load import parse_body

        return parse_body(data, f"{self.name}.{self.format}", self.map)


@dataclass(frozen=True)
class FileRecipe:
    """A file that can be made of a motion's npz.

    Attributes:
        format: an installed format.
        export: options of the file.
            Those that the format does not have are ignored: `check_options` refuses them.
        fps: its frame rate; None = that of the motion.
        rig: the rig that the options name as `rig` or `body`; None = none, a reference rig or `standard`.
    """

    format: str
    export: ExportOptions = PLAIN
    fps: float | None = None
    rig: RigFile | None = None

    @property
    def plain(self) -> bool:
        """True if a stored file of the format is this file."""
        return not self.export.chosen and self.fps is None

    @property
    def chosen(self) -> dict[str, Any]:
        """Options that differ from the defaults, by name in alphabetical order."""
        return dict(sorted(self.export.values.items()))

    def key(self, source: str) -> str:
        """Return the sha256 that identifies the file among all that were ever made.

        Args:
            source: sha256 of the npz.

        Raises:
            PluginError: the format is not installed.
        """
        parts = [source, self.format, self.chosen, self.fps, version_of(self.format)]
        if self.rig is not None:
            parts += [self.rig.sha256, self.rig.format, self.rig.map]
        text = json.dumps(parts, separators=(",", ":"), allow_nan=False, sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()

    def check(self) -> None:
        """Validate that this process can make the file, before its npz is made or fetched.

        Raises:
            MissingExtra: an extra that writes the format is not installed.
            InvalidInput: the format needs an option that is not given.
            NotFound, InvalidFile, TooLarge: the file of a rig that the format needs cannot be read.
            PluginError: the format is not installed.
        """
        exporter = exporter_of(self.format)
        with extra("motion"):
            import_module("numpy")
            if exporter.check is not None:
                exporter.check(self.export)

    def make(self, npz: bytes, where: str, rig: bytes = b"") -> bytes:
        """Return the content of the file; equal arguments give equal bytes.

        Args:
            npz: the motion.
            where: its name in errors.
            rig: the file of the rig, where the recipe has one.

        Raises:
            MissingExtra: an extra that writes the format is not installed.
            InvalidInput: the rate is out of bounds, or the motion cannot be written like this.
            InvalidFile, TooLarge: the npz cannot be read, or the file would be too large.
            PluginError: the format is not installed.
        """
        exporter = exporter_of(self.format)
        decode = exporters()[CANONICAL].decode
        assert decode is not None
        with extra("motion"):
            named = None if self.rig is None else self.rig.body(rig)
            clip = decode(npz, where, Coordinates())
            if self.fps is not None:
                clip = _at_rate(clip, self.fps)
            return exporter.write(clip, Coordinates.of(self.export), named)


def _at_rate(clip: Any, fps: float) -> Any:
    from marey.motion.resample import resample

    try:
        return resample(clip, fps)
    except InvalidInput as error:
        error.where = error.where or "fps"
        raise
