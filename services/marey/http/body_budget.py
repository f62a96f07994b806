"""Budget of large bodies: bytes that one process keeps in files at the same time."""

from __future__ import annotations

import asyncio
from collections import Counter, deque
from collections.abc import AsyncGenerator
from contextlib import asynccontextmanager
from dataclasses import dataclass, field

from marey.core.errors import Overloaded
from marey.items.item import MAX_BODY_BYTES

ROOM_BYTES = 3 * MAX_BODY_BYTES
"""Bytes in files of the temporary folder. In docker-compose.yml that is in memory: 256 MB, of the container's 1 GiB."""
TENANT_BYTES = 2 * MAX_BODY_BYTES
"""Bytes of one tenant: others always find some."""
WAIT_SECONDS = 10.0
WAITING = 32
"""Maximum waiting requests; their clients have sent only what fits into the buffers of a socket. A tenant may have
at most as many as are free: others always find one."""
RETRY_SECONDS = 5


@dataclass(eq=False)
class _Waiter:
    tenant: str
    size: int
    turn: asyncio.Future[None] = field(default_factory=lambda: asyncio.get_running_loop().create_future())


class BodyBudget:
    """Grants bytes in order of arrival; on the event loop alone.

    A request whose tenant is at its limit is overtaken by requests of others.
    """

    def __init__(self, total: int = ROOM_BYTES, tenant: int = TENANT_BYTES, *, seconds: float = WAIT_SECONDS) -> None:
        self._total, self._tenant, self._seconds = total, tenant, seconds
        self._used = 0
        self._by_tenant: Counter[str] = Counter()
        self._waiting: deque[_Waiter] = deque()

    @property
    def used(self) -> int:
        """Granted bytes."""
        return self._used

    @asynccontextmanager
    async def take(self, tenant: str, size: int) -> AsyncGenerator[None]:
        """Hold `size` bytes during the block; waits for them.

        Raises:
            Overloaded: no budget within `seconds`, or too many waiting requests.
        """
        await self._wait(tenant, size)
        try:
            yield
        finally:
            self._give_back(tenant, size)
            self._admit()

    async def _wait(self, tenant: str, size: int) -> None:
        of_tenant = sum(waiter.tenant == tenant for waiter in self._waiting)
        if of_tenant >= WAITING - len(self._waiting):
            raise _overloaded()
        waiter = _Waiter(tenant, size)
        self._waiting.append(waiter)
        self._admit()
        try:
            async with asyncio.timeout(self._seconds):
                await asyncio.shield(waiter.turn)
        except TimeoutError:
            if not waiter.turn.done():
                self._forget(waiter)
                raise _overloaded() from None
        except asyncio.CancelledError:
            if waiter.turn.done():  # granted, but the waiter was cancelled
                self._give_back(tenant, size)
            self._forget(waiter)
            raise

    def _give_back(self, tenant: str, size: int) -> None:
        self._used -= size
        self._by_tenant[tenant] -= size
        if not self._by_tenant[tenant]:
            del self._by_tenant[tenant]

    def _forget(self, waiter: _Waiter) -> None:
        if waiter in self._waiting:
            self._waiting.remove(waiter)
        self._admit()  # it may have blocked others

    def _admit(self) -> None:
        """Grant waiting requests in order."""
        for waiter in tuple(self._waiting):
            if self._by_tenant[waiter.tenant] + waiter.size > self._tenant:
                continue
            if self._used + waiter.size > self._total:
                return
            self._waiting.remove(waiter)
            self._used += waiter.size
            self._by_tenant[waiter.tenant] += waiter.size
            waiter.turn.set_result(None)


def _overloaded() -> Overloaded:
    return Overloaded(
        "other large requests are being read",
        where="body",
        hint="Send it again after the seconds in `Retry-After`.",
        seconds=RETRY_SECONDS,
    )
