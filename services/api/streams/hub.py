"""What the sockets of one process share: the way to Redis, threads to wait in, and how many may be open."""

# pyright: reportMissingTypeStubs=false
from __future__ import annotations

from collections.abc import Callable, Generator
from contextlib import contextmanager
from typing import TypeVar

from anyio import CapacityLimiter, to_thread

from shared.errors import Busy
from shared.metrics import SOCKETS as SOCKETS_OPEN
from shared.runtime.queue import redis_client

Answer = TypeVar("Answer")

SOCKETS = 200
"""Open at once in one process: each waits for its frames in a thread of its own."""
CALLS = 16
"""Threads for all that answers at once; the database's pool holds 20, and the routes want some."""
RETRY_SECONDS = 5


class Hub:
    """Made once a process, on its event loop; connects to nothing before it is asked.

    Args:
        url: of the Redis that holds the frames.
    """

    def __init__(self, url: str) -> None:
        # The sockets would use twice as many as redis-py's own 100 connections.
        self.redis = redis_client(url, max_connections=2 * SOCKETS)
        self._reads = CapacityLimiter(SOCKETS)
        self._calls = CapacityLimiter(CALLS)
        self._places = SOCKETS

    async def wait(self, read: Callable[[], Answer]) -> Answer:
        """What a read that waits gives; for one at a time of each socket. Who goes away does not wait for it."""
        return await to_thread.run_sync(read, limiter=self._reads, abandon_on_cancel=True)

    async def call(self, function: Callable[[], Answer]) -> Answer:
        """What a function that answers soon gives: of Redis, or of the database."""
        return await to_thread.run_sync(function, limiter=self._calls)

    @contextmanager
    def place(self) -> Generator[None]:
        """One of the sockets that may be open at once.

        Raises:
            Busy: all are.
        """
        if not self._places:
            raise Busy(f"{SOCKETS} sockets are open at this process, and no more may be", seconds=RETRY_SECONDS)
        self._places -= 1
        SOCKETS_OPEN.inc()
        try:
            yield
        finally:
            self._places += 1
            SOCKETS_OPEN.dec()

    def close(self) -> None:
        """Give the connections back."""
        self.redis.close()
