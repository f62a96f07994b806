"""Leases of this process: a thread renews them and learns of cancelled and lost items."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Collection, Iterable
from uuid import UUID

from marey.core.errors import Unreachable
from marey.jobs import Claim, HeartbeatReply
from marey.runtime.logs import logger
from marey.runtime.telemetry import ClaimTelemetry

log = logger(__name__)

LOOK_SECONDS = 1.0
AGAIN_SECONDS = 1.0
"""Seconds until the retry of a failed renewal: a lease must outlast a connection that fell silent."""

Renew = Callable[[UUID, Collection[UUID], bool], HeartbeatReply]
"""Renews one lease in the database, given its token, open items and progress. Raises `Unreachable`."""


class HeldLease:
    """A claim in progress: shared state of the handler and the heartbeat.

    Implements the `BatchControl` of `marey.runtime.handler`. Its state is a few attributes replaced atomically, so
    the decode loop needs no lock.
    """

    def __init__(self, claim: Claim, stopping: threading.Event) -> None:
        self.claim = claim
        self.telemetry = ClaimTelemetry(claim)
        self._stopping = stopping
        self._everything = frozenset(item.id for item in claim.items)
        self._open = self._everything
        self._gone: frozenset[UUID] = frozenset()
        self._moved = True
        self._moved_at = time.monotonic()
        self._exempt = False
        self._handed_over = False
        self._taken_up = False

    def progress(self, done: int, total: int) -> None:
        """Record progress: `done` of `total` steps."""
        self._moved = True
        self._moved_at = time.monotonic()
        self._exempt = False

    def dropped(self) -> frozenset[UUID]:
        """Return items whose result is no longer wanted; all of them when the worker stops or the lease is lost."""
        return self._everything if self._stopping.is_set() else self._gone

    @property
    def lost(self) -> frozenset[UUID]:
        """Return items that are no longer under this lease: their results are discarded."""
        return self._gone

    @property
    def open(self) -> frozenset[UUID]:
        """Return items that are neither committed, failed nor released, and still leased as far as known."""
        return self._open - self._gone

    def settle(self, items: Iterable[UUID]) -> None:
        """Mark items as written or lost: the heartbeat no longer includes them."""
        self._open = self._open - frozenset(items)

    def exempt(self) -> None:
        """Allow silence: loading and the first compile may take minutes. Ends with the next `progress`."""
        self._exempt = True

    def stuck(self, seconds: float) -> bool:
        """Return True if every item was lost and the batch has stalled: it will not notice by itself."""
        silent = time.monotonic() - self._moved_at
        return self._gone >= self._everything and not self._excused and silent > seconds

    def take_progress(self) -> bool:
        """Return True if the batch moved since the last call (or is exempt)."""
        moved, self._moved = self._moved or self._excused, False
        return moved

    def hand_over(self) -> None:
        """Mark the handler as done. Until `take_up` the batch waits for the results before it, and may be silent."""
        self._handed_over = True

    def take_up(self) -> None:
        """Mark the start of writing its results: from here on silence counts again."""
        self._taken_up = True
        self.progress(0, 0)

    @property
    def _excused(self) -> bool:
        return self._exempt or (self._handed_over and not self._taken_up)

    def learn(self, answer: HeartbeatReply) -> None:
        """Apply the database's reply."""
        self._gone = self._everything if answer.lost else self._gone | answer.gone


class Heartbeat(threading.Thread):
    """Renews every held lease each `interval` seconds, on its own connection, and polls each second in between for lost
    items: cancelled items leave the batch within two seconds, a decode step included.

    A batch that is silent for too long is not renewed: the database measures that by its own clock. During an outage
    of the database the lease is kept here: the fence decides at the commit.
    """

    def __init__(
        self,
        renew: Renew,
        *,
        interval: float,
        stopping: threading.Event,
        present: Callable[[], None] = lambda: None,
        held_by: Callable[[UUID], frozenset[UUID]] | None = None,
        look_seconds: float = LOOK_SECONDS,
        stall_seconds: float = math.inf,
        stuck: Callable[[], None] = lambda: None,
    ) -> None:
        """`present`, called after each round, says that this worker lives; `held_by` reads the items of a lease. Both
        raise `Unreachable` at most. `stuck` is called when a batch hangs: nothing of it is ours any more, and it has
        not moved for `stall_seconds`."""
        super().__init__(name="heartbeat", daemon=True)
        self._renew = renew
        self._present = present
        self._held_by = held_by
        self._look_seconds = look_seconds
        self._stall_seconds = stall_seconds
        self._stuck = stuck
        self._interval = interval
        self._stopping = stopping
        self._held: dict[UUID, HeldLease] = {}
        self._closed = threading.Event()

    def hold(self, claim: Claim) -> HeldLease:
        """Keep the lease of `claim` alive until `let_go`."""
        lease = HeldLease(claim, self._stopping)
        self._held[claim.lease_token] = lease
        return lease

    def let_go(self, lease: HeldLease) -> None:
        """Stop renewing; the caller has written or given up every item."""
        self._held.pop(lease.claim.lease_token, None)

    def run(self) -> None:
        due = time.monotonic() + self._interval
        while not self._closed.wait(self._pause(due)):
            if time.monotonic() < due:
                self.look()
                continue
            renewed = self.beat()
            self._end_stuck()
            try:
                self._present()
            except Unreachable as error:
                log.warning("presence_failed", error=error.message)
            except Exception:
                log.exception("presence_failed")  # without this thread every lease here would expire
            due = time.monotonic() + (self._interval if renewed else min(self._interval, AGAIN_SECONDS))

    def close(self) -> None:
        """End the thread; leases still held expire by themselves."""
        self._closed.set()

    def _end_stuck(self) -> None:
        for lease in list(self._held.values()):
            if lease.stuck(self._stall_seconds):
                with lease.telemetry.bound():
                    log.error("batch_hangs", items=len(lease.claim.items), seconds=self._stall_seconds)
                self._stuck()

    def _pause(self, due: float) -> float:
        """Return seconds until the next action."""
        left = max(due - time.monotonic(), 0.0)
        return left if self._held_by is None else min(left, self._look_seconds)

    def look(self) -> None:
        """Poll for lost items, without renewing anything. Outages are reported by renewals."""
        if self._held_by is None:
            return
        for token, lease in list(self._held.items()):
            items = lease.open
            if not items:
                continue
            try:
                held = self._held_by(token)
            except Unreachable:
                continue
            except Exception:
                log.exception("look_failed")
                continue
            lease.learn(HeartbeatReply(lost=False, gone=items - held))

    def beat(self) -> bool:
        """Renew each lease once; return False if the database did not answer for one of them."""
        answered = True
        for token, lease in list(self._held.items()):
            items = lease.open
            if not items:
                continue
            try:
                answer = self._renew(token, items, lease.take_progress())
            except Unreachable as error:
                log.warning("heartbeat_failed", error=error.message)
                answered = False
                continue
            except Exception:
                log.exception("heartbeat_failed")
                continue
            if answer.gone or answer.lost:
                lease.learn(answer)
                if lease.open != items:  # not merely committed in between
                    with lease.telemetry.bound():
                        log.info("items_taken_away", lost=answer.lost, items=len(answer.gone))
        return answered
