"""`/v1/motions`."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated
from uuid import UUID

from fastapi import APIRouter, Header, Path, Response
from fastapi.responses import RedirectResponse, StreamingResponse

from services.api.auth import Reader
from services.api.context import Connection, Shared
from services.api.motions.ranges import ByteRange, parse_range
from services.api.motions.schemas import FileView, MotionDetailView, MotionView
from services.api.problems import RESPONSES
from services.api.schemas import Cursor, Limit, PageView
from shared import jobs
from shared.errors import NotFound
from shared.storage import Opened

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


@router.get(
    "/{motion}/files/{format}",
    response_class=Response,
    responses={
        200: {"content": {"application/octet-stream": {"schema": {"type": "string", "format": "binary"}}}},
        206: {"description": "The range asked for"},
        304: {"description": "The client has it"},
        307: {"description": "At a URL signed for 15 minutes"},
        416: {"description": "The range begins past the end"},
    },
)
def get_file(
    motion: UUID,
    format: Annotated[str, Path(pattern=r"^[a-z0-9]{1,16}$", description="`npz`, `bvh`, …")],
    shared: Shared,
    conn: Connection,
    key: Reader,
    byte_range: Annotated[str | None, Header(alias="Range")] = None,
    if_range: Annotated[str | None, Header(alias="If-Range")] = None,
    if_none_match: Annotated[str | None, Header(alias="If-None-Match")] = None,
) -> Response:
    """A file of a motion; its ETag is its sha256."""
    row = jobs.get_motion(conn, key.tenant, motion)
    file = next((f for f in MotionView.of(row).files if f.format == format), None)
    if file is None:
        made = ", ".join(f.format for f in row.files)
        raise NotFound(f"the motion was not made as {format}", where=str(motion), hint=f"It has {made}.")
    etag = f'"{file.sha256}"'
    if if_none_match is not None and (etag in if_none_match or if_none_match.strip() == "*"):
        return Response(status_code=304, headers={"ETag": etag})
    object_key = jobs.asset_key(key.tenant, file.sha256)
    url = shared.store.presign(object_key, filename=f"{row.id}.{format}", media_type=file.media_type)
    if url is not None:
        return RedirectResponse(url, status_code=307)
    wanted = None if if_range not in (None, etag) else parse_range(byte_range, file.size)
    headers = {
        "ETag": etag,
        "Accept-Ranges": "bytes",
        "Cache-Control": "private, immutable, max-age=86400",
        "Content-Disposition": f'attachment; filename="{row.id}.{format}"',
    }
    return _content(shared.store.open, object_key, file, wanted, headers)


def _content(open_object, key: str, file: FileView, wanted: ByteRange | None, headers: dict[str, str]) -> Response:
    if wanted is None:
        opened: Opened = open_object(key)
        headers["Content-Length"] = str(opened.size)
        return StreamingResponse(_read(opened), headers=headers, media_type=file.media_type)
    if wanted.start >= file.size:
        return Response(status_code=416, headers={"Content-Range": f"bytes */{file.size}"})
    opened = open_object(key, wanted.start, wanted.length)
    headers["Content-Length"] = str(wanted.length)
    headers["Content-Range"] = f"bytes {wanted.start}-{wanted.start + wanted.length - 1}/{file.size}"
    return StreamingResponse(_read(opened), status_code=206, headers=headers, media_type=file.media_type)


def _read(opened: Opened) -> Iterator[bytes]:
    try:
        yield from opened.chunks
    finally:
        opened.close()
