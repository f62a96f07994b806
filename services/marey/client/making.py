"""Files that the server does not have: another format, or one with options. They are made here of the npz, or by the
server where they need a rig of its."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from marey.client.rigs import Rigs
from marey.core.errors import Conflict, InvalidInput, NotFound
from marey.core.extras import extra
from marey.exporters import exporters
from marey.exporters.exporter import EVERYWHERE
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


def asked_of(name: str, stored: Collection[str], export: ExportOptions) -> Mapping[str, str | bool] | None:
    """Return the options of a file that the server makes on a rig or a body of its own, None if it is not such a file.

    Args:
        name: the format.
        stored: formats that the server has of the motion.
        export: options that the file is to have.
    """
    if export.server_rig is None:
        return None
    exporter = exporters().get(name)
    heeded = EVERYWHERE if exporter is None else exporter.heeded
    asked = {option: value for option, value in export.values.items() if option in heeded}
    return asked if asked or name not in stored else None


def check_body(export: ExportOptions) -> None:
    """Read the body or the rig that an export names, so that an error comes before anything is fetched or submitted;
    one of the server is left to `check_rig`.

    Raises:
        NotFound, InvalidFile, InvalidInput: the file is missing, or no human body; a map is given for a rig of the
            server; or numpy is not installed.
    """
    if export.server_rig is not None:
        if export.rig_map is not None:
            raise InvalidInput(
                "a rig of the server has a map of its own",
                where="rig_map",
                hint="Leave it out, or add the rig again with this map.",
                argument="rig_map",
            )
    elif export.body is not None:
        with extra("motion"):
            from marey.motion.change_body import load_shape
        load_shape(export.body, export.rig_map)
    elif export.rig is not None:
        with extra("motion"):
            from marey.motion.retarget import load_body
        load_body(export.rig, export.rig_map)


def check_formats(formats: Sequence[str] | None, export: ExportOptions) -> None:
    """Validate, before a job is submitted, that this process can make the files that the server will not have.

    Args:
        formats: of the files that are to be fetched; None = those that the server has.
        export: options of the files.

    Raises:
        MissingExtra: an extra that writes a format is not installed.
        InvalidInput: a format needs an option that is not given.
    """
    stored = {name for name, exporter in exporters().items() if exporter.stored}
    for name in formats or ():
        recipe = None if asked_of(name, stored, export) is not None else making_of(name, stored, export)
        if recipe is not None:
            recipe.check()


def check_rig(rigs: Rigs, export: ExportOptions) -> None:
    """Find the rig of the server that an export names, if it does.

    Raises:
        NotFound: there is no such rig.
    """
    if export.server_rig is None:
        return
    try:
        rigs.get(export.server_rig)
    except NotFound as error:
        error.where = error.argument = "rig" if export.rig else "body"
        error.hint = f"`marey rigs list` shows those of the server; a file has an ending: {export.server_rig}.fbx."
        raise
