"""`/v1/streams`."""

from __future__ import annotations

from typing import Annotated
from uuid import UUID

from fastapi import APIRouter, Query, Response, WebSocket
from fastapi.concurrency import run_in_threadpool

from marey import streams
from marey.api.auth import Reader, Submitter
from marey.api.context import Connection, Shared
from marey.api.streams import service
from marey.api.streams.accept import accept_connection
from marey.api.streams.end_pose import read_end_pose
from marey.api.streams.schemas import EndStreamBody, NewStreamBody, StreamDetailView, StreamView
from marey.http.json_bodies import UniqueKeysRoute
from marey.http.problems import RESPONSES
from marey.http.schemas import Cursor, Limit, PageView

router = APIRouter(prefix="/v1/streams", tags=["streams"], responses=RESPONSES, route_class=UniqueKeysRoute)


@router.post("", status_code=201)
def begin_stream(body: NewStreamBody, response: Response, shared: Shared, key: Submitter) -> StreamDetailView:
    """Create a live stream; its frames come over the WebSocket at its path.

    It waits while all slots of all workers are taken. 429 if the key has reached its limit of open streams.
    """
    view = service.begin(shared, key, body)
    response.headers["Location"] = f"/v1/streams/{view.id}"
    return view


@router.get("")
def list_streams(
    shared: Shared,
    conn: Connection,
    key: Reader,
    is_open: Annotated[bool, Query(alias="open", description="Only open streams.")] = False,
    cursor: Cursor = None,
    limit: Limit = 50,
) -> PageView[StreamView]:
    """List live streams, newest first."""
    page = streams.list_streams(conn, key.tenant, is_open=is_open, cursor=cursor, limit=limit)
    made = service.made_by_each(shared, page.rows)
    items = [StreamView.of(row, by) for row, by in zip(page.rows, made, strict=True)]
    return PageView[StreamView](items=items, next=page.cursor)


@router.get("/{stream}")
def get_stream(stream: UUID, shared: Shared, conn: Connection, key: Reader) -> StreamDetailView:
    """Get one live stream, with its recorded prompts and its skeleton."""
    return service.detail(conn, shared, streams.get_stream(conn, key.tenant, stream))


@router.post("/{stream}/end", status_code=202)
async def end_stream(stream: UUID, body: EndStreamBody, shared: Shared, key: Submitter) -> StreamDetailView:
    """End a live stream on a pose, into which its last second passes; its clip ends in the pose, too.

    A waiting stream ends at once; 409 if it has ended.
    """
    service.hub_of(shared)
    pose = await read_end_pose(shared, key, stream, body.pose)
    row = await run_in_threadpool(service.stop_on, shared, key, stream, pose)
    return await run_in_threadpool(service.current, shared, row)


@router.delete("/{stream}", status_code=202)
def stop_stream(stream: UUID, shared: Shared, key: Submitter) -> StreamDetailView:
    """Ask a live stream to end; a waiting one ends at once, and one that has ended stays as it is."""
    service.hub_of(shared)
    return service.current(shared, service.stop(shared, key, stream))


@router.websocket("/{stream}")
async def watch_stream(websocket: WebSocket, stream: str, shared: Shared) -> None:
    """Stream frames from `from` on, and accept control messages."""
    await accept_connection(websocket, stream, shared)
