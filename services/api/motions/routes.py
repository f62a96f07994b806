"""`/v1/motions`."""

from __future__ import annotations

from typing import Annotated
from uuid import UUID

from fastapi import APIRouter, Path, Response

from services.api.auth import Reader
from services.api.context import Connection, Shared
from services.api.files import FILE_RESPONSES, AskedPart, file_response
from services.api.motions.schemas import MotionDetailView, MotionView
from services.api.problems import RESPONSES
from services.api.schemas import Cursor, Limit, PageView
from shared import jobs
from shared.errors import NotFound

router = APIRouter(prefix="/v1/motions", tags=["motions"], responses=RESPONSES)


@router.get("")
def list_motions(conn: Connection, key: Reader, cursor: Cursor = None, limit: Limit = 50) -> PageView[MotionView]:
    """Motions, newest first."""
    page = jobs.list_motions(conn, key.tenant, cursor=cursor, limit=limit)
    return PageView[MotionView](items=[MotionView.of(row) for row in page.rows], next=page.cursor)


@router.get("/{motion}")
def get_motion(motion: UUID, conn: Connection, key: Reader) -> MotionDetailView:
    """One motion, with the graph and settings it was made from."""
    return MotionDetailView.of(jobs.get_motion(conn, key.tenant, motion))


@router.get("/{motion}/files/{format}", response_class=Response, responses=FILE_RESPONSES)
def get_file(
    motion: UUID,
    format: Annotated[str, Path(pattern=r"^[a-z0-9]{1,16}$", description="`npz`, `bvh`, …")],
    shared: Shared,
    conn: Connection,
    key: Reader,
    part: AskedPart,
) -> Response:
    """A file of a motion; its ETag is its sha256."""
    row = jobs.get_motion(conn, key.tenant, motion)
    file = next((f for f in MotionView.of(row).files if f.format == format), None)
    if file is None:
        made = ", ".join(f.format for f in row.files)
        raise NotFound(f"the motion was not made as {format}", where=str(motion), hint=f"It has {made}.")
    return file_response(shared, key.tenant, row.id, file, part)
