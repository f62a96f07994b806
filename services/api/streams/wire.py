"""One open socket: what is sent, in which order, and how it is closed. And the protocol class that keeps it honest."""

from __future__ import annotations

import asyncio
import socket
from contextlib import suppress
from typing import Any

import structlog
from anyio import Lock
from fastapi import WebSocket
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

from services.api.problems import problem_body, public_error
from services.api.streams.schemas import ErrorMessage, SocketMessage
from shared.errors import MareyError

log = structlog.get_logger(__name__)

AWAY = 1013
"""Close code: try again later."""
TOLD = (401, 403, 404, 422)
"""HTTP statuses that are close codes too, with 4000 added; what has another may work later."""
REASON_BYTES = 123  # RFC 6455
BUFFER_BYTES = 4096
"""Twenty frames of 22 joints, a second."""
PING_SECONDS, PONG_SECONDS = 20.0, 20.0
"""Between an answer and the next ping, and for the answer."""
FLUSH_SECONDS = 5.0
"""For what is still on its way when a socket is closed."""


class Wire:
    """Sends whole messages, one after the other, until it is closed. Each send waits until the one before is on its
    way: what a slow client does not take is never kept here."""

    def __init__(self, websocket: WebSocket) -> None:
        self._websocket = websocket
        self._lock = Lock()
        self._closed = False

    async def receive(self) -> bytes | None:
        """The next message of the client; None when it, or the server, goes away."""
        message = await self._websocket.receive()
        if message["type"] == "websocket.disconnect":
            return None
        text: str | None = message.get("text")
        return message["bytes"] if text is None else text.encode()

    async def send(self, data: bytes) -> None:
        """A binary message.

        Raises:
            WebSocketDisconnect: the client is gone.
        """
        async with self._lock:
            if not self._closed:
                await self._websocket.send_bytes(data)

    async def tell(self, message: SocketMessage) -> None:
        """A text message; raises as `send`."""
        # As over HTTP: a problem leaves out what it has not, everything else says null.
        text = message.model_dump_json(exclude_none=isinstance(message, ErrorMessage))
        async with self._lock:
            if not self._closed:
                await self._websocket.send_text(text)

    async def complain(self, error: MareyError) -> None:
        """Tell what is wrong, and stay; raises as `send`."""
        await self.tell(ErrorMessage(problem=problem_body(error)))

    async def refuse(self, error: MareyError) -> None:
        """Close for an error, and tell what clients may know of it; raises as `send`."""
        if error.status >= 500:
            log.warning("stream_socket_closed", error=str(error))
        await self.close(close_code(error), public_error(error).message)

    async def close(self, code: int, reason: str = "") -> None:
        """The last thing that is sent; raises as `send`."""
        async with self._lock:
            if not self._closed:
                self._closed = True
                await self._websocket.close(code, reason.encode()[:REASON_BYTES].decode(errors="ignore"))


def close_code(error: MareyError) -> int:
    """With which code a socket is closed for this error."""
    return 4000 + error.status if error.status in TOLD else AWAY


class StreamProtocol(WebSocketsSansIOProtocol):
    """uvicorn's WebSockets with buffers that hold no more than two seconds of frames.

    Its own, and those of the kernel, hold minutes of them: sends would go on long after the client stopped to take
    what is sent, and what it then gets first is as old.

    A socket that is closed is gone soon, too. asyncio closes a connection when all is sent, which a client that takes
    nothing puts off for ever: it would keep its place here, and the stream that it had us pause.
    """

    def __init__(self, *args: object, **options: object) -> None:
        super().__init__(*args, **options)  # type: ignore[arg-type]
        self.conn.debug = False  # it would write headers to the log, and with them the key

    def keepalive_timeout(self) -> None:
        """A ping was not answered."""
        super().keepalive_timeout()
        self._cut_after(FLUSH_SECONDS)

    def shutdown(self) -> None:
        """The server stops."""
        super().shutdown()
        self._cut_after(FLUSH_SECONDS)

    async def send(self, message: Any) -> None:
        """Send what the application says."""
        await super().send(message)
        if message["type"] == "websocket.close":
            self._cut_after(self.close_timeout + FLUSH_SECONDS)

    def _cut_after(self, seconds: float) -> None:
        self.loop.call_later(seconds, self.transport.abort)  # nothing, where the connection is gone by then

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Open the connection."""
        super().connection_made(transport)
        self.transport.set_write_buffer_limits(high=BUFFER_BYTES)
        unsent = getattr(socket, "TCP_NOTSENT_LOWAT", None)  # Linux and macOS
        if unsent is not None:
            with suppress(OSError):  # not TCP
                self.transport.get_extra_info("socket").setsockopt(socket.IPPROTO_TCP, unsent, BUFFER_BYTES)
