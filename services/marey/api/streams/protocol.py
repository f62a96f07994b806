"""uvicorn's WebSocket protocol class with small buffers and bounded closing."""

from __future__ import annotations

import asyncio
import socket
from contextlib import suppress
from typing import Any

from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

BUFFER_BYTES = 4096
"""Bytes of twenty frames of 22 joints, one second."""
MAX_MESSAGE = 64 * 2**10
"""Bytes. A message over its route's limit is answered; a message over this one is not even read."""
PING_SECONDS, PONG_SECONDS = 20.0, 20.0
"""Seconds between an answer and the next ping, and for the answer."""
FLUSH_SECONDS = 5.0
"""Seconds for pending data when a socket is closed."""


class StreamProtocol(WebSocketsSansIOProtocol):
    """uvicorn's WebSockets with buffers that hold no more than two seconds of frames.

    The default buffers, and those of the kernel, hold minutes of frames: sends would succeed long after the client
    stopped reading, and the client would then receive old frames.

    A closed socket ends soon, too. asyncio closes a connection when everything is sent, which a client that reads
    nothing delays for ever: it would keep its slot, and its stream paused.
    """

    def __init__(self, *args: object, **options: object) -> None:
        super().__init__(*args, **options)  # type: ignore[arg-type]
        self.conn.debug = False  # it would log headers, including the key

    def keepalive_timeout(self) -> None:
        """Handle an unanswered ping."""
        super().keepalive_timeout()
        self._cut_after(FLUSH_SECONDS)

    def shutdown(self) -> None:
        """Handle a server stop."""
        super().shutdown()
        self._cut_after(FLUSH_SECONDS)

    async def send(self, message: Any) -> None:
        """Send a message of the application."""
        await super().send(message)
        if message["type"] == "websocket.close":
            self._cut_after(self.close_timeout + FLUSH_SECONDS)

    def _cut_after(self, seconds: float) -> None:
        self.loop.call_later(seconds, self.transport.abort)  # does nothing if the connection is already closed

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Open the connection."""
        super().connection_made(transport)
        self.transport.set_write_buffer_limits(high=BUFFER_BYTES)
        unsent = getattr(socket, "TCP_NOTSENT_LOWAT", None)  # Linux and macOS
        if unsent is not None:
            with suppress(OSError):  # not TCP
                self.transport.get_extra_info("socket").setsockopt(socket.IPPROTO_TCP, unsent, BUFFER_BYTES)


def socket_options() -> dict[str, Any]:
    """Return the arguments of uvicorn for WebSockets."""
    return {
        "ws": StreamProtocol,
        "ws_max_size": MAX_MESSAGE,
        "ws_ping_interval": PING_SECONDS,
        "ws_ping_timeout": PONG_SECONDS,
        "ws_per_message_deflate": False,  # rotations hardly compress, and each socket would need a window
    }
