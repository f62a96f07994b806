"""Slots for open sockets and event streams of one process, with a limit per tenant and per key."""

from __future__ import annotations

from collections import Counter
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TypeVar
from uuid import UUID

from prometheus_client import Gauge

from marey.core.errors import Busy
from marey.tenants import ApiKey

Name = TypeVar("Name", str, UUID)

RETRY_SECONDS = 5


@dataclass(frozen=True)
class SlotLimits:
    """Slots of one process, and the limits of one tenant and one key."""

    total: int
    tenant: int
    key: int


class SlotCounter:
    """Counts open connections; on the event loop alone.

    A tenant may hold no more slots than are free. So a tenant without any always finds one: with `n` greedy tenants,
    one in `n + 1` slots stays free.
    """

    def __init__(self, what: str, shares: SlotLimits, gauge: Gauge | None = None) -> None:
        """Set the limits; `what` is the plural noun for messages."""
        self._what, self._shares, self._gauge = what, shares, gauge
        self._tenants: Counter[str] = Counter()
        self._keys: Counter[UUID] = Counter()

    @property
    def taken(self) -> int:
        """Number of occupied slots."""
        return self._tenants.total()

    @contextmanager
    def take(self, key: ApiKey) -> Generator[None]:
        """Hold one slot during the block.

        Raises:
            Busy: the key or its tenant has reached its limit, or no slot is free.
        """
        self._check(key)
        self._count(key, 1)
        try:
            yield
        finally:
            self._count(key, -1)

    def _check(self, key: ApiKey) -> None:
        shares, free = self._shares, self._shares.total - self.taken
        if self._keys[key.id] >= shares.key:
            raise self._busy(f"this key has {shares.key} {self._what} open, its limit", "key")
        of_tenant = self._tenants[key.tenant]
        if of_tenant >= shares.tenant:
            raise self._busy(f"the tenant has {shares.tenant} {self._what} open, its limit", "tenant")
        if of_tenant >= free:
            whose = f"the tenant has {of_tenant} {self._what} open and {free} are free for others"
            raise self._busy(whose if of_tenant else f"no more {self._what} may be open at this process", "server")

    def _busy(self, message: str, whose: str) -> Busy:
        hint = "Close one, or try again after the seconds in `Retry-After`."
        return Busy(message, where=f"{self._what} of the {whose}", hint=hint, seconds=RETRY_SECONDS)

    def _count(self, key: ApiKey, by: int) -> None:
        _add(self._tenants, key.tenant, by)
        _add(self._keys, key.id, by)
        if self._gauge is not None:
            self._gauge.inc(by)


def _add(table: Counter[Name], name: Name, by: int) -> None:
    """Add to a counter, and drop entries at 0."""
    table[name] += by
    if not table[name]:
        del table[name]
