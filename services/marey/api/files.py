"""Stored files over HTTP: sent from a folder, with ranges, or by redirect to a signed URL."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from email.utils import format_datetime
from typing import Annotated, Any

from fastapi import Depends, Header, Query, Request, Response
from fastapi.responses import RedirectResponse, StreamingResponse

from marey.api.context import Context
from marey.core.disposition import attachment
from marey.http.ranges import ByteRange, parse_range
from marey.http.schemas import View
from marey.jobs import asset_key
from marey.storage import CHUNK, PRESIGN_SECONDS, AssetStore, Opened

MARGIN_SECONDS = 60
FOR_EVER = "private, immutable, max-age=86400"
CHECKED = "private, no-cache"
"""Cache-Control of files whose content may differ after an upgrade of the server: caches ask, and get a 304."""

FILE_RESPONSES: dict[int | str, dict[str, Any]] = {
    200: {"content": {"application/octet-stream": {"schema": {"type": "string", "format": "binary"}}}},
    206: {"description": "The range asked for"},
    304: {"description": "The client has it"},
    307: {"description": "At a URL signed for 15 minutes; `Expires` says until when"},
    416: {"description": "The range begins past the end"},
}


class FileView(View):
    """One stored file."""

    format: str
    sha256: str
    size: int
    media_type: str


@dataclass(frozen=True)
class RequestedFile:
    """Headers and options of a file request."""

    request: Request
    byte_range: str | None
    if_range: str | None
    if_none_match: str | None
    redirect: bool


async def requested_file(
    request: Request,
    byte_range: Annotated[str | None, Header(alias="Range")] = None,
    if_range: Annotated[str | None, Header(alias="If-Range")] = None,
    if_none_match: Annotated[str | None, Header(alias="If-None-Match")] = None,
    redirect: Annotated[
        bool, Query(description="False = this server sends the content, even if it could redirect to a bucket.")
    ] = True,
) -> RequestedFile:
    """Return the headers and options of a file request. Async: needs no thread."""
    return RequestedFile(request, byte_range, if_range, if_none_match, redirect)


FileRequest = Annotated[RequestedFile, Depends(requested_file)]


def file_response(
    shared: Context, tenant: str, name: str, file: FileView, part: RequestedFile, *, caching: str = FOR_EVER
) -> Response:
    """Answer a request for a file. Its ETag is its SHA-256; HEAD reports the whole file's size.

    Args:
        name: name of the download (`download_name`).
        caching: Cache-Control of the content.
    """
    etag = f'"{file.sha256}"'
    if part.if_none_match is not None and (etag in part.if_none_match or part.if_none_match.strip() == "*"):
        return Response(status_code=304, headers={"ETag": etag})
    headers = {
        "ETag": etag,
        "Accept-Ranges": "bytes",
        "Cache-Control": caching,
        "Content-Disposition": attachment(name),
    }
    if part.request.method == "HEAD":  # also for a bucket, whose URLs are signed for GET only
        return Response(headers={**headers, "Content-Length": str(file.size)}, media_type=file.media_type)
    object_key = asset_key(tenant, file.sha256)
    if part.redirect and (url := shared.store.presign(object_key, filename=name, media_type=file.media_type)):
        return RedirectResponse(url, status_code=307, headers=_valid_for(PRESIGN_SECONDS))
    wanted = None if part.if_range not in (None, etag) else parse_range(part.byte_range, file.size)
    return _content(shared.store, object_key, file, wanted, headers)


def _valid_for(seconds: int) -> dict[str, str]:
    """Return the Cache-Control of a signed URL; a cache may use it a little shorter than it is valid."""
    return {
        "Cache-Control": f"private, max-age={seconds - MARGIN_SECONDS}",
        "Expires": format_datetime(datetime.now(UTC) + timedelta(seconds=seconds), usegmt=True),
    }


def _content(
    store: AssetStore, key: str, file: FileView, wanted: ByteRange | None, headers: dict[str, str]
) -> Response:
    if wanted is None:
        opened = store.open(key)
        return _sent(opened, opened.size, file, headers)
    if wanted.start >= file.size:
        return Response(status_code=416, headers={"Content-Range": f"bytes */{file.size}"})
    opened = store.open(key, wanted.start, wanted.length)
    headers["Content-Range"] = f"bytes {wanted.start}-{wanted.start + wanted.length - 1}/{file.size}"
    return _sent(opened, wanted.length, file, headers, status=206)


def _sent(opened: Opened, length: int, file: FileView, headers: dict[str, str], status: int = 200) -> Response:
    """Stream the content; send it directly if it is one chunk, as nearly all motions are: each chunk of a stream
    changes threads twice, which costs more than the read."""
    headers["Content-Length"] = str(length)
    if length <= CHUNK:
        return Response(b"".join(read_chunks(opened)), status, headers, file.media_type)
    return StreamingResponse(read_chunks(opened), status, headers, file.media_type)


def read_chunks(opened: Opened) -> Iterator[bytes]:
    """Yield the content of an open object, and close it."""
    try:
        yield from opened.chunks
    finally:
        opened.close()
