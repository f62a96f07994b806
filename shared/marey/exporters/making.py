"""Files made of a stored npz: another format, another rate, or options. Importing this needs the standard library
only."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from typing import Any

from marey.core.errors import InvalidInput
from marey.core.extras import needs_extra
from marey.exporters.exporter import Coordinates
from marey.exporters.registry import CANONICAL, exporter_of, exporters, version_of
from marey.motion.export_options import PLAIN, ExportOptions


@dataclass(frozen=True)
class FileRecipe:
    """A file that can be made of a motion's npz.

    Attributes:
        format: an installed format.
        export: options of the file.
            Those that the format does not have are ignored: `check_options` refuses them.
        fps: its frame rate; None = that of the motion.
    """

    format: str
    export: ExportOptions = PLAIN
    fps: float | None = None

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
        return hashlib.sha256(json.dumps(parts, separators=(",", ":"), allow_nan=False).encode()).hexdigest()

    def make(self, npz: bytes, where: str) -> bytes:
        """Return the content of the file; equal arguments give equal bytes.

        Args:
            npz: the motion.
            where: its name in errors.

        Raises:
            MissingExtra: an extra that writes the format is not installed.
            InvalidInput: the rate is out of bounds, or the motion cannot be written like this.
            InvalidFile, TooLarge: the npz cannot be read, or the file would be too large.
            PluginError: the format is not installed.
        """
        exporter = exporter_of(self.format)
        decode = exporters()[CANONICAL].decode
        assert decode is not None
        try:
            clip = decode(npz, where, Coordinates())
            if self.fps is not None:
                clip = _at_rate(clip, self.fps)
            return exporter.write(clip, Coordinates.of(self.export))
        except ImportError as error:
            raise needs_extra("motion", error) from error


def _at_rate(clip: Any, fps: float) -> Any:
    from marey.motion.resample import resample

    try:
        return resample(clip, fps)
    except InvalidInput as error:
        error.where = error.where or "fps"
        raise
