"""Files that the server does not have, made here of the npz: another format, or one with options."""

from __future__ import annotations

from collections.abc import Collection

from marey.core.errors import Conflict
from marey.core.extras import needs_extra
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

    Raises:
        Conflict: a body is wanted, and there is no npz to put on it, or the format is not installed here.
    """
    exporter = exporters().get(name)
    if exporter is None or SOURCE not in stored:
        if export.body is not None and name in stored:
            missing = f"no exporter of {name} is installed here" if exporter is None else f"it has no {SOURCE}"
            raise Conflict(f"cannot be put on another body: {missing}", where=f"format {name}", hint="Leave it out.")
        return None
    if name in stored and not exporter.heeded.intersection(export.chosen):
        return None
    return FileRecipe(name, export)


def check_body(body: str | None) -> None:
    """Read the body that an export names, so that an error comes before anything is fetched or submitted.

    Raises:
        NotFound, InvalidFile, InvalidInput: the file is missing, or no human body; or numpy is not installed.
    """
    if body is None:
        return
    try:
        from marey.motion.change_body import load_shape
    except ImportError as error:
        raise needs_extra("motion", error) from error
    load_shape(body)
