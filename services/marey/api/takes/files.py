"""Files of a motion: stored ones, and what a request for others asks for."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any
from uuid import UUID

from fastapi.responses import JSONResponse, Response
from pydantic import Field

from marey import jobs
from marey.api.context import Context
from marey.api.making.query import export_options
from marey.core.errors import NotFound
from marey.db import transaction
from marey.exporters import check_options, exporters
from marey.exporters.making import FileRecipe, RigFile
from marey.exporters.registry import CANONICAL
from marey.http.schemas import View
from marey.jobs.types import MotionFile
from marey.motion.export_options import OWN_BODIES, REFERENCE_RIGS
from marey.takes import RigRow, get_rig

RETRY_SECONDS = 2


class MakingView(View):
    """A file that is being made."""

    format: str
    retry_after: int = Field(description="Seconds after which to ask again, as in `Retry-After`.")


MAKING_RESPONSES: dict[int | str, dict[str, Any]] = {
    202: {"model": MakingView, "description": "It is being made; ask again after `Retry-After` seconds"},
}


def motion_and_rig(
    shared: Context, tenant: str, motion: UUID, *, rig: str | None, body: str | None
) -> tuple[jobs.MotionRow, RigRow | None]:
    """Return a motion, and the tenant's rig that a request names as `rig` or as `body`; None if it names none, or one
    of Marey's.

    Raises:
        NotFound: the tenant has no such motion, or no such rig.
        InvalidInput: the request names both.
    """
    with transaction(shared.engine) as conn:
        row = jobs.get_motion(conn, tenant, motion)
        export_options({"rig": rig, "body": body})
        name = rig if rig is not None else body
        if name is None or name in (REFERENCE_RIGS if rig is not None else OWN_BODIES):
            return row, None
        try:
            return row, get_rig(conn, tenant, name)
        except NotFound as error:
            error.where = "rig" if rig is not None else "body"
            raise


def rig_header(rig: RigRow) -> dict[str, str]:
    """Return the header that says which version of a rig a file is made on, or has the proportions of."""
    return {"Marey-Rig": f"{rig.name}; version={rig.version}; sha256={rig.sha256}"}


def recipe(
    row: jobs.MotionRow, format: str, given: Mapping[str, Any], fps: float | None, rig: RigRow | None
) -> FileRecipe:
    """Return the file that a request asks for.

    Args:
        given: options, by name.
        fps: frames a second; None = the motion's.
        rig: the tenant's rig that the options name; None = none, or one of Marey's.

    Raises:
        NotFound: the motion has no such file, and no installed exporter makes it.
        InvalidInput: options that contradict each other, or that the format does not have.
    """
    exporter = exporters().get(format)
    if exporter is None and row.file(format) is None:
        raise _no_file(row, format)
    export = export_options(given)
    if exporter is not None:
        check_options([exporter], export)
    file = None if rig is None else RigFile(rig.name, rig.format, rig.sha256, rig.map)
    return FileRecipe(format, export, None if fps == row.fps else fps, file)


def stored_file(row: jobs.MotionRow, wanted: FileRecipe) -> MotionFile | None:
    """Return the stored file that is the wanted one; None if it is to be made.

    Raises:
        NotFound: it cannot be made, because its format is not installed here.
    """
    file = row.file(wanted.format)
    if wanted.plain and file is not None:
        return file
    if wanted.format not in exporters():
        raise _no_file(row, wanted.format)
    return None


def source_of(row: jobs.MotionRow) -> str:
    """Return the sha256 of the npz that files are made of.

    Raises:
        NotFound: there is none.
    """
    source = row.file(CANONICAL)
    if source is None:
        hint = "If its prompt is being erased, wait a moment."
        raise NotFound(f"the motion has no {CANONICAL} to make the file of", where=str(row.id), hint=hint)
    return source.sha256


def being_made(format: str) -> Response:
    """Return the answer for a file that is not there yet."""
    body = MakingView(format=format, retry_after=RETRY_SECONDS)
    headers = {"Retry-After": str(RETRY_SECONDS), "Cache-Control": "no-store"}
    return JSONResponse(body.model_dump(), 202, headers=headers)


def _no_file(row: jobs.MotionRow, format: str) -> NotFound:
    have = ", ".join(file.format for file in row.files)
    made = ", ".join(exporters())
    return NotFound(
        f"the motion was not made as {format}, and this server does not make such files",
        where=str(row.id),
        hint=f"It has {have}; the server makes {made}.",
    )
