"""Writer of one open socket: ordered messages, and closing."""

from __future__ import annotations

import structlog
from anyio import Lock
from fastapi import WebSocket

from marey.api.streams.schemas import ErrorMessage, SocketMessage
from marey.core.errors import MareyError
from marey.http.problems import problem_body, public_error

log = structlog.get_logger(__name__)

AWAY = 1013
"""Close code: try again later."""
TOLD = (401, 403, 404, 422)
"""HTTP statuses that become close codes, with 4000 added; others may work later."""
REASON_BYTES = 123  # RFC 6455


class SocketWriter:
    """Sends whole messages, one after the other, until it is closed. Each send waits until the one before is on its
    way: nothing is buffered here for a slow client."""

    def __init__(self, websocket: WebSocket) -> None:
        self._websocket = websocket
        self._lock = Lock()
        self._closed = False

    async def receive(self) -> bytes | None:
        """Return the next message of the client; None on disconnect or server stop."""
        message = await self._websocket.receive()
        if message["type"] == "websocket.disconnect":
            return None
        text: str | None = message.get("text")
        return message["bytes"] if text is None else text.encode()

    async def send(self, data: bytes) -> None:
        """Send a binary message.

        Raises:
            WebSocketDisconnect: the client is gone.
        """
        async with self._lock:
            if not self._closed:
                await self._websocket.send_bytes(data)

    async def send_message(self, message: SocketMessage) -> None:
        """Send a text message; raises as `send`."""
        # As over HTTP: a problem omits empty fields, other messages have null.
        text = message.model_dump_json(exclude_none=isinstance(message, ErrorMessage))
        async with self._lock:
            if not self._closed:
                await self._websocket.send_text(text)

    async def send_error(self, error: MareyError) -> None:
        """Send an error, and keep the socket open; raises as `send`."""
        await self.send_message(ErrorMessage(problem=problem_body(error)))

    async def refuse(self, error: MareyError) -> None:
        """Close for an error, with the part of its message that clients may see; raises as `send`."""
        if error.status >= 500:
            log.warning("stream_socket_closed", error=str(error))
        await self.close(close_code(error), public_error(error).message)

    async def close(self, code: int, reason: str = "") -> None:
        """Close the socket; raises as `send`."""
        async with self._lock:
            if not self._closed:
                self._closed = True
                await self._websocket.close(code, reason.encode()[:REASON_BYTES].decode(errors="ignore"))


def close_code(error: MareyError) -> int:
    """Return the close code of an error."""
    return 4000 + error.status if error.status in TOLD else AWAY
