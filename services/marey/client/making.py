"""Files that the server does not have, made here of the npz: another format, or one with options."""

from __future__ import annotations

from collections.abc import Collection

from marey.exporters import exporters
from marey.exporters.making import FileRecipe
from marey.motion.export_options import ExportOptions

SOURCE = "npz"


def making_of(name: str, stored: Collection[str], export: ExportOptions) -> FileRecipe | None:
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
    return FileRecipe(name, export)
