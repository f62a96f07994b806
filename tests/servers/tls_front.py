"""TLS in front of a server that speaks plain TCP: decrypts and forwards, byte by byte."""

from __future__ import annotations

import asyncio
import contextlib
import ssl

from tests.servers.loop_thread import LoopThread, relay

CHUNK = 64 * 1024


class TlsFront(LoopThread):
    """Forward TLS connections to `localhost` until the end of the `with` block.

    Args:
        context: of a server (`Authority.server("localhost")`).
        target: host and port of the plain server.
        port: to listen on; 0 = any free one.

    Attributes:
        port: on which it listens, on 127.0.0.1.
        connections: handshakes that succeeded so far.
    """

    def __init__(self, context: ssl.SSLContext, target: tuple[str, int], *, port: int = 0) -> None:
        self.port = port
        self.connections = 0
        self._context = context
        self._target = target
        super().__init__("TLS front")

    async def _listen(self) -> asyncio.Server:
        self._loop.set_exception_handler(lambda *_: None)  # failed handshakes are what tests provoke
        server = await asyncio.start_server(self._serve, "127.0.0.1", self.port, ssl=self._context)
        self.port = server.sockets[0].getsockname()[1]
        return server

    async def _answer(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.connections += 1
        inner_reader, inner_writer = await asyncio.open_connection(*self._target)
        try:
            await relay(_pump(reader, inner_writer), _pump(inner_reader, writer))
        finally:
            inner_writer.close()


async def _pump(source: asyncio.StreamReader, sink: asyncio.StreamWriter) -> None:
    with contextlib.suppress(OSError):
        while data := await source.read(CHUNK):
            sink.write(data)
            await sink.drain()
