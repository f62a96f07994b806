"""Export formats of motions, found through the entry-point group `marey.exporters`.

A format is one module with an `Exporter`, such as `npz.py`, and one line in `pyproject.toml`, Marey's or a plug-in's:
see docs/extending.md. Importing this package needs the standard library only.
"""

from marey.exporters.exporter import Coordinates, Exporter
from marey.exporters.registry import (
    GROUP,
    check_known,
    check_options,
    check_writers,
    exporter_for,
    exporter_named,
    exporter_of,
    exporters,
    extension_of,
)
from marey.exporters.rigged import write_rigged

__all__ = [
    "GROUP",
    "Coordinates",
    "Exporter",
    "check_known",
    "check_options",
    "check_writers",
    "exporter_for",
    "exporter_named",
    "exporter_of",
    "exporters",
    "extension_of",
    "write_rigged",
]
