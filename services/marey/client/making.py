"""Files that the server does not have, made here of the npz: another format, or one with options."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

from marey.core.extras import needs_extra
from marey.exporters import Coordinates, Exporter, exporters
from marey.motion.export_options import ExportOptions

SOURCE = "npz"


@dataclass(frozen=True)
class Making:
    """A file to be made of a motion's npz."""

    exporter: Exporter[Any]
    coordinates: Coordinates

    def make(self, npz: bytes, where: str) -> bytes:
        """Return the content of the file.

        Args:
            npz: the motion.
            where: it, in errors.

        Raises:
            InvalidInput: the extra that writes the format is not installed, or the motion cannot be written in it.
            InvalidFile: the npz cannot be read.
        """
        try:
            decode = exporters()[SOURCE].decode
            assert decode is not None
            return self.exporter.write(decode(npz, where, Coordinates()), self.coordinates)
        except ImportError as error:
            raise needs_extra("motion", error) from error


def making_of(name: str, stored: Collection[str], export: ExportOptions) -> Making | None:
    """Return how a file of a format is made, None if it is fetched as the server has it.

    Args:
        name: the format.
        stored: formats that the server has of the motion.
        export: options that the file is to have.
    """
    exporter = exporters().get(name)
    if exporter is None or SOURCE not in stored:
        return None
    if name in stored and not exporter.options.intersection(export.chosen):
        return None
    return Making(exporter, Coordinates.of(export))
