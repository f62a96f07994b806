"""uvicorn's WebSocket protocol class with small buffers and bounded closing."""

from __future__ import annotations

import asyncio
import socket
from contextlib import suppress
from typing import Any

from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

BUFFER_BYTES = 4096
"""Twenty frames of 22 joints, a second."""
MAX_MESSAGE = 64 * 2**10
"""Bytes. A message that is too long for its route is answered; one longer than this is not even read."""
PING_SECONDS, PONG_SECONDS = 20.0, 20.0
"""Between an answer and the next ping, and for the answer."""
FLUSH_SECONDS = 5.0
"""For what is still on its way when a socket is closed."""


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
        self.loop.call_later(seconds, self.transport.abort)  # nothing, where the connection is gone by then

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
        "ws_per_message_deflate": False,  # rotations hardly shrink, and each socket would pay for a window
    }
