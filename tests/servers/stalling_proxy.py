"""A TCP proxy that can fall silent: connections stay open, and nothing is forwarded any more.

The fault of a firewall that drops a flow, a hung load balancer or a stopped server: the client's kernel sees a living
peer that acknowledges every byte, so neither keepalives nor `tcp_user_timeout` find it. Only a deadline does.
"""

from __future__ import annotations

import asyncio
import socket
import struct

from tests.servers.loop_thread import LoopThread, relay

CHUNK = 64 * 1024
DRIP_SECONDS = 0.2


class _Link:
    """One client connection and its connection to the server."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, task: asyncio.Task[None]) -> None:
        self.reader = reader
        self.task = task
        self.writer = writer
        self.flowing = asyncio.Event()
        self.flowing.set()
        self.dripping = False
        self.abandoned = False


class StallingProxy(LoopThread):
    """Forward TCP connections on 127.0.0.1 to a server until the end of the `with` block.

    Args:
        target: path of a Unix socket, or (host, port).
        port: to listen on; 0 = any free one.
        pace: bytes per second of one connection in one direction; None = as fast as it can.
    """

    def __init__(self, target: str | tuple[str, int], *, port: int = 0, pace: float | None = None) -> None:
        self._target = target
        self._pace = pace
        self._wanted_port = port
        self._links: set[_Link] = set()
        self._stall_new = False
        self.port = 0
        super().__init__("stalling proxy")

    @property
    def connections(self) -> int:
        """The number of open client connections, silent ones included."""
        return len(self._links)

    @property
    def silent(self) -> int:
        """The number of open client connections that are silent."""
        return sum(not link.flowing.is_set() for link in list(self._links))

    def stall(self, *, new: bool = False) -> int:
        """Make every open connection silent, in both directions; return how many.

        Args:
            new: accept later connections, but make them silent too.
        """
        return self._call(self._stall(new))

    def resume(self, *, old: bool = False) -> None:
        """Forward new connections again.

        Args:
            old: let silent connections go on, with what was sent meanwhile. By default they stay silent for ever.
        """
        self._call(self._resume(old))

    def drip(self) -> None:
        """Let the server's answers on every open connection through byte by byte, `DRIP_SECONDS` apart."""
        self._call(self._drip())

    def reset(self) -> None:
        """Reset every open connection of a client, and keep that to the server open, as some firewalls do."""
        self._call(self._reset())

    def cut(self, *, silent: bool = False) -> None:
        """Close every open connection, also towards the server.

        Args:
            silent: close only those that are silent.
        """
        self._call(self._cut(silent))

    async def _listen(self) -> asyncio.Server:
        listening = socket.create_server(("127.0.0.1", self._wanted_port), backlog=128)
        if self._pace is not None:  # connections inherit it: else the kernel would take megabytes at once
            listening.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, CHUNK)
        server = await asyncio.start_server(self._serve, sock=listening)
        self.port = listening.getsockname()[1]
        return server

    async def _stall(self, new: bool) -> int:
        self._stall_new = new
        for link in self._links:
            link.flowing.clear()
        return len(self._links)

    async def _resume(self, old: bool) -> None:
        self._stall_new = False
        if old:
            for link in self._links:
                link.flowing.set()

    async def _reset(self) -> None:
        for link in self._links:
            link.abandoned = True
            connected = link.writer.get_extra_info("socket")
            connected.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            link.writer.transport.abort()

    async def _drip(self) -> None:
        for link in self._links:
            link.dripping = True

    async def _cut(self, silent: bool = False) -> None:
        tasks = [link.task for link in self._links if not (silent and link.flowing.is_set())]
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    async def _answer(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None
        link = _Link(reader, writer, task)
        if self._stall_new:
            link.flowing.clear()
        self._links.add(link)
        try:
            await self._forward(link)
        finally:
            self._links.discard(link)

    async def _forward(self, link: _Link) -> None:
        await link.flowing.wait()
        if isinstance(self._target, str):
            reader, writer = await asyncio.open_unix_connection(self._target)
        else:
            reader, writer = await asyncio.open_connection(*self._target)
        there = _pump(link, link.reader, writer, self._pace)
        back = _pump(link, reader, link.writer, self._pace, answers=True)
        try:
            await relay(there, back, hold=lambda: link.abandoned)
        finally:
            writer.close()


async def _pump(
    link: _Link,
    reader: asyncio.StreamReader,
    writer: asyncio.StreamWriter,
    pace: float | None,
    *,
    answers: bool = False,
) -> None:
    while data := await reader.read(CHUNK):
        await link.flowing.wait()
        while answers and link.dripping and data:
            writer.write(data[:1])
            data = data[1:]
            await asyncio.sleep(DRIP_SECONDS)
        writer.write(data)
        await writer.drain()
        if pace is not None:
            await asyncio.sleep(len(data) / pace)
