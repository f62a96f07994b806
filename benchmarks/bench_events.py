"""Events of one job to very many clients: server-sent events of one API process, on plain sockets.

The operator pauses and resumes the job, and each client notes when it received the event. The floor in the same run is
a server that writes the same bytes to as many sockets and does nothing else.
"""

from __future__ import annotations

import asyncio
import contextlib
import statistics
import time
from dataclasses import dataclass, field

import psutil
import sqlalchemy as sa

from benchmarks.platform import BUNDLE, Platform, platform, processor_seconds
from marey.db import transaction

CLIENTS = (100, 500, 1000, 2000, 4000)
CHANGES = 6
CONNECTING = 50
"""Connections that are being opened at once: uvicorn's backlog is 2,048, a client's patience shorter."""
SETTLE = 1.5
"""Seconds between two changes; events of one job are read twice a second at most."""
LIMIT = 60.0


@dataclass
class Crowd:
    """Results of many clients."""

    clients: int
    connect: float = 0.0
    """Seconds until all had the events that stood."""
    delays: list[list[float]] = field(default_factory=list[list[float]])
    """Of each change, seconds from its commit until each client had it."""
    cpu: float = 0.0
    """Seconds of the server's processor a change."""
    megabytes: float = 0.0
    """Of the server's memory, beyond none connected."""
    connections: int = 0
    """To the database, beyond none connected."""


class Reader:
    """One client: the highest event id it has seen, and when."""

    def __init__(self) -> None:
        self.seen = 0
        self.at = 0.0
        self._writer: asyncio.StreamWriter | None = None
        self._task: asyncio.Task[None] | None = None

    async def connect(self, host: str, port: int, request: bytes) -> None:
        """Send the request, and begin to read."""
        reader, self._writer = await asyncio.open_connection(host, port)
        self._writer.write(request)
        self._task = asyncio.create_task(self._read(reader))

    async def _read(self, reader: asyncio.StreamReader) -> None:
        async for line in reader:
            if line.startswith(b"id: "):
                self.seen, self.at = int(line[4:]), time.perf_counter()

    def close(self) -> None:
        """Hang up."""
        if self._writer is not None and self._task is not None:
            self._task.cancel()
            self._writer.close()


def main() -> None:
    """Print both tables."""
    shares = ("", "_PER_TENANT", "_PER_KEY")
    with platform(**{f"MAREY_EVENT_STREAMS{share}": str(3 * CLIENTS[-1]) for share in shares}) as cluster:
        server = cluster.serve()
        print("| clients | all connected | median | 99th | last | CPU a change | memory a client | connections |")
        print("|---|---|---|---|---|---|---|---|")
        for count in CLIENTS:
            row = asyncio.run(_product(cluster, server, count))
            print(f"| {_cells(row)} | {row.megabytes * 1024 / count:.0f} KB | {row.connections:+d} |", flush=True)
    print("\nThe floor: the same bytes from a bare asyncio server in this process\n")
    print("| clients | all connected | median | 99th | last | CPU a change, clients included |")
    print("|---|---|---|---|---|---|")
    for count in CLIENTS:
        print(f"| {_cells(asyncio.run(_floor(count)))} |")


def _cells(row: Crowd) -> str:
    delays = sorted(delay for change in row.delays for delay in change)
    median, high = statistics.median(delays), statistics.quantiles(delays, n=100)[-1]
    last = statistics.median(max(change) for change in row.delays)
    times = f"{median * 1e3:.0f} ms | {high * 1e3:.0f} ms | {last * 1e3:.0f} ms"
    return f"{row.clients:,} | {row.connect:.1f} s | {times} | {row.cpu * 1e3:.0f} ms"


async def _product(cluster: Platform, server: psutil.Process, count: int) -> Crowd:
    with cluster.client() as client:
        job = client.submit([{"prompt": "walk", "model": BUNDLE}])["id"]
        path = f"/v1/jobs/{job}/events"
        request = (
            f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1\r\nAuthorization: Bearer {cluster.key}\r\n"
            "Accept: text/event-stream\r\n\r\n"
        ).encode()
        crowd = Crowd(count)
        connections, memory = _connections(cluster), server.memory_info().rss
        readers = await _connect(crowd, cluster.port, request)
        await asyncio.sleep(SETTLE)
        crowd.connections = _connections(cluster) - connections
        crowd.megabytes = (server.memory_info().rss - memory) / 2**20
        for number in range(CHANGES):
            before = processor_seconds(server)
            verb = "resume" if number % 2 else "pause"
            row = await asyncio.to_thread(client.post, f"/v1/jobs/{job}/{verb}")
            committed = time.perf_counter()
            await _all_have(readers, row["event_seq"])
            crowd.delays.append([reader.at - committed for reader in readers])
            crowd.cpu += (processor_seconds(server) - before) / CHANGES
            await asyncio.sleep(SETTLE)
        for reader in readers:
            reader.close()
        await asyncio.sleep(SETTLE)
        return crowd


async def _floor(count: int) -> Crowd:
    """Two events of the product's length, written to every socket in a loop."""
    message = b"event: state\r\ndata: " + b"x" * 420 + b"\r\nid: %d\r\n\r\n"
    writers: list[asyncio.StreamWriter] = []

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.readuntil(b"\r\n\r\n")
        writer.write(message % 1)
        writers.append(writer)

    crowd, own = Crowd(count), psutil.Process()
    server = await asyncio.start_server(serve, "127.0.0.1", 0, backlog=2048)
    readers = await _connect(crowd, server.sockets[0].getsockname()[1], b"GET / HTTP/1.1\r\n\r\n")
    for number in range(CHANGES):
        before, sent = processor_seconds(own), time.perf_counter()
        for writer in writers:
            writer.write(message % (2 * number + 2) + message % (2 * number + 3))
        await _all_have(readers, 2 * number + 3)
        crowd.delays.append([reader.at - sent for reader in readers])
        crowd.cpu += (processor_seconds(own) - before) / CHANGES
    for reader in readers:
        reader.close()
    server.close()
    for writer in writers:
        writer.close()
    with contextlib.suppress(TimeoutError):
        await asyncio.wait_for(server.wait_closed(), 5)
    return crowd


async def _connect(crowd: Crowd, port: int, request: bytes) -> list[Reader]:
    readers = [Reader() for _ in range(crowd.clients)]
    door = asyncio.Semaphore(CONNECTING)

    async def one(reader: Reader) -> None:
        async with door:
            await reader.connect("127.0.0.1", port, request)
            while reader.seen < 1:
                await asyncio.sleep(0.01)

    started = time.perf_counter()
    async with asyncio.timeout(LIMIT * 2):
        await asyncio.gather(*(one(reader) for reader in readers))
    crowd.connect = time.perf_counter() - started
    return readers


async def _all_have(readers: list[Reader], seq: int) -> None:
    async with asyncio.timeout(LIMIT):
        while any(reader.seen < seq for reader in readers):
            await asyncio.sleep(0.02)


def _connections(cluster: Platform) -> int:
    with transaction(cluster.engine) as conn:
        query = "SELECT count(*) FROM pg_stat_activity WHERE backend_type = 'client backend'"
        return conn.execute(sa.text(query)).scalar_one()


if __name__ == "__main__":
    main()
