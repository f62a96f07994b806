"""Leases of this process: a thread renews them, learns what was cancelled or lost, and stops renewing a stuck batch."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable
from uuid import UUID

from shared.errors import Unreachable
from shared.jobs.types import Claim
from shared.runtime.logs import logger

log = logger(__name__)

Renew = Callable[[UUID], set[UUID]]
"""Renews one lease by its token in the database; gives the items that are still ours. Raises `Unreachable`."""


class HeldLease:
    """A claim being worked on: what the handler tells the heartbeat and what the heartbeat tells the handler.

    It is the `BatchControl` of `shared.runtime.handler`. One writer for each field, so no lock is needed.
    """

    def __init__(self, claim: Claim, stopping: threading.Event, stall_seconds: float) -> None:
        self.claim = claim
        self._everything = frozenset(item.id for item in claim.items)
        self._gone: frozenset[UUID] = frozenset()
        self._stopping = stopping
        self._stall_seconds = stall_seconds
        self._progressed: float | None = None
        self.stalled = False

    def progress(self, done: int, total: int) -> None:
        """`done` of `total` steps: the batch is alive."""
        self._progressed = time.monotonic()

    def dropped(self) -> frozenset[UUID]:
        """Items whose result nobody wants; all of them when the worker stops or the batch was given up."""
        return self._everything if self._stopping.is_set() or self.stalled else self._gone

    def lost(self) -> frozenset[UUID]:
        """Items that are no longer ours: a result for them is thrown away."""
        return self._everything if self.stalled else self._gone

    def suspend_stall_clock(self) -> None:
        """Loading and the first compile make no progress for minutes; the clock starts at the next `progress`."""
        self._progressed = None

    def is_stuck(self) -> bool:
        """Whether the decode loop was silent for longer than allowed."""
        return self._progressed is not None and time.monotonic() - self._progressed > self._stall_seconds

    def keep(self, still_ours: Iterable[UUID]) -> None:
        """What the database says is still leased to this token."""
        self._gone = self._everything - frozenset(still_ours)


class Heartbeat(threading.Thread):
    """Renews every held lease each `interval` seconds, on its own connection.

    A lease that cannot be renewed because the database is away is not given up here: the fence decides at the commit.
    """

    def __init__(self, renew: Renew, *, interval: float, stall_seconds: float, stopping: threading.Event) -> None:
        super().__init__(name="heartbeat", daemon=True)
        self._renew = renew
        self._interval = interval
        self._stall_seconds = stall_seconds
        self._stopping = stopping
        self._held: dict[UUID, HeldLease] = {}
        self._closed = threading.Event()

    def hold(self, claim: Claim) -> HeldLease:
        """Keep the lease of `claim` alive until `let_go`."""
        lease = HeldLease(claim, self._stopping, self._stall_seconds)
        self._held[claim.lease_token] = lease
        return lease

    def let_go(self, lease: HeldLease) -> None:
        """Stop renewing; the caller has committed or released every item."""
        self._held.pop(lease.claim.lease_token, None)

    def run(self) -> None:
        while not self._closed.wait(self._interval):
            self.beat()

    def close(self) -> None:
        """End the thread; leases still held run out by themselves."""
        self._closed.set()

    def beat(self) -> None:
        """Renew each lease once."""
        for token, lease in list(self._held.items()):
            if lease.is_stuck():
                log.error("lease_given_up", reason="no progress", items=len(lease.claim.items))
                lease.stalled = True
                self._held.pop(token, None)
                continue
            try:
                lease.keep(self._renew(token))
            except Unreachable as error:
                log.warning("heartbeat_failed", error=error.message)
