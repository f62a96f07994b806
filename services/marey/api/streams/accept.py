"""Acceptance of WebSocket connections: key, stream and options."""

from __future__ import annotations

from contextlib import suppress
from typing import Literal, cast, get_args
from uuid import UUID

import structlog
from fastapi import WebSocket
from starlette.datastructures import QueryParams
from starlette.websockets import WebSocketDisconnect

from marey.api.auth import authenticated, authorize, check_scope
from marey.api.context import Context
from marey.api.streams import service
from marey.api.streams.session import SessionRequest, StreamSession
from marey.api.streams.socket_writer import SocketWriter
from marey.core.errors import InvalidInput, MareyError, NotFound
from marey.db import transaction
from marey.http.problems import public_error
from marey.streams import get_stream, prompts_with_rewrites

PROTOCOL = "marey.stream.v1"
KEY_PREFIX = "marey.key."
"""Prefix of the subprotocol that carries a key: a browser cannot send headers with a socket."""
MAX_FRAME = 2**32
Slow = Literal["skip", "pause"]
SLOW: tuple[str, ...] = get_args(Slow)
QUERY = ("from", "slow")

log = structlog.get_logger(__name__)


async def accept_connection(websocket: WebSocket, stream: str, shared: Context) -> None:
    """Serve a stream to a client until it ends or the client disconnects; refusals are reported by close code.

    The handshake always succeeds: a browser does not reveal the body of a refused one.
    """
    offered: list[str] = websocket.scope["subprotocols"]
    writer = SocketWriter(websocket)
    with suppress(WebSocketDisconnect):
        await websocket.accept(PROTOCOL if PROTOCOL in offered else None)
        try:
            hub = service.hub_of(shared)
            secret = key_of(websocket.headers.get("authorization"), offered)
            request = await hub.call(lambda: _authorize(shared, secret, stream, websocket.query_params))
            with hub.slots.take(request.key):
                await StreamSession(writer, hub, shared, request).run()
        except MareyError as error:
            await writer.refuse(error)
        except Exception:
            log.exception("stream_socket_failed", stream=stream[:64])
            await writer.close(1011, public_error(MareyError("internal")).message)


def key_of(header: str | None, offered: list[str]) -> str | None:
    """Return the API key of a client: `Authorization: Bearer …`, else a subprotocol."""
    scheme, _, secret = (header or "").partition(" ")
    if scheme.lower() == "bearer":
        return secret.strip()
    return next((name.removeprefix(KEY_PREFIX) for name in offered if name.startswith(KEY_PREFIX)), None)


def _authorize(shared: Context, secret: str | None, stream: str, query: QueryParams) -> SessionRequest:
    """Return the validated request of a client.

    Raises:
        Unauthenticated, Refused, InvalidInput, NotFound: by the cause.
    """
    key = authenticated(shared, secret)
    authorize(shared, key, "read")
    _check_names(query)
    first, slow = first_frame(query.get("from")), _slow(query.get("slow"))
    if slow == "pause":
        check_scope(key, "submit")  # a pause is a control message, which needs the scope
    try:
        identifier = UUID(stream)
    except ValueError:
        raise NotFound("there is no such stream", where=f"stream {stream[:64]}") from None
    with transaction(shared.engine) as conn:
        row = get_stream(conn, key.tenant, identifier)
        return SessionRequest(
            key, row, prompts_with_rewrites(conn, identifier), service.made_by(shared, row), first, slow == "pause"
        )


def _check_names(query: QueryParams) -> None:
    """Validate query parameters, as `queries.check_query` does for routes: a misspelt `from` would start the stream
    from its beginning."""
    for name in query:
        if name not in QUERY:
            raise InvalidInput(f"unknown parameter {name[:40]!r}; known: {', '.join(QUERY)}", where="query")
        if len(query.getlist(name)) > 1:
            raise InvalidInput("is given twice", where=name, hint="Give it once.")


def first_frame(given: str | None) -> int:
    """Parse the number of the first requested frame.

    Raises:
        InvalidInput: not a frame number.
    """
    if given is None:
        return 0
    if not given.isascii() or not given.isdecimal() or int(given[:20]) >= MAX_FRAME:
        raise InvalidInput(f"{given[:40]!r} is not the number of a frame", where="from")
    return int(given)


def _slow(given: str | None) -> Slow:
    if given is not None and given not in SLOW:
        raise InvalidInput(f"{given[:40]!r} is neither {' nor '.join(SLOW)}", where="slow")
    return cast("Slow", given or SLOW[0])
