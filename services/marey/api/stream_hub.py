"""Shared objects of the sockets of one process: Redis client, threads for blocking reads, and socket slots."""

# pyright: reportMissingTypeStubs=false
from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from anyio import CapacityLimiter, to_thread

from marey.core.metrics import SOCKETS as SOCKETS_OPEN
from marey.http.slots import SlotCounter, SlotLimits
from marey.runtime.queue import redis_client

Answer = TypeVar("Answer")

SOCKETS = 200
"""Maximum open sockets per process: each waits for its frames in a thread of its own."""
CALLS = 16
"""Threads for short calls; the database's pool has 20 connections, of which routes need some."""


class Hub:
    """Created once per process, on its event loop; connects lazily.

    Args:
        url: URL of the Redis with the frames.
        tenant, key: maximum open sockets of one tenant or key.
    """

    def __init__(self, url: str, *, tenant: int = SOCKETS, key: int = SOCKETS) -> None:
        # The sockets would use twice as many as redis-py's own limit of 100 connections.
        self.redis = redis_client(url, max_connections=2 * SOCKETS)
        self._reads = CapacityLimiter(SOCKETS)
        self._calls = CapacityLimiter(CALLS)
        self.slots = SlotCounter("sockets", SlotLimits(SOCKETS, tenant, key), SOCKETS_OPEN)

    async def wait(self, read: Callable[[], Answer]) -> Answer:
        """Run a blocking read in a thread; one at a time per socket. A cancelled caller does not wait for it."""
        return await to_thread.run_sync(read, limiter=self._reads, abandon_on_cancel=True)

    async def call(self, function: Callable[[], Answer]) -> Answer:
        """Run a function that returns soon in a thread: of Redis, or of the database."""
        return await to_thread.run_sync(function, limiter=self._calls)

    def close(self) -> None:
        """Close the connections."""
        self.redis.close()
