"""One thread per process that listens for new events and feeds every open event stream."""

from __future__ import annotations

import asyncio
import contextlib
import threading
import time
from collections import defaultdict
from collections.abc import AsyncIterator, Callable, Iterable, Iterator
from dataclasses import dataclass, field
from uuid import UUID

import sqlalchemy as sa
import structlog

from marey.core.errors import InvalidInput, NotFound, Unreachable
from marey.db import EVENT_CHANNEL, Listener, transaction
from marey.jobs import EventRow, events_after
from marey.jobs.states import ENDED
from marey.tenants import ApiKey, keys_still_valid

log = structlog.get_logger(__name__)

PERIOD = 0.5
"""Seconds between two reads of one job: at most two progress messages a second."""
WAIT = 0.25
REREAD_SECONDS = 10.0
"""Seconds between reads of each followed job, with or without a notification."""
RECONNECT_SECONDS, REFUSED_SECONDS = 0.5, 30.0
KEY_SECONDS = 2.0
"""Seconds between checks of the followers' keys, as for sockets."""
QUEUE_LIMIT = 1000
"""Batches a slow client may lag behind before its stream is closed; it reconnects with Last-Event-ID."""
PROGRESS = "progress"

CLOSED = None


@dataclass(frozen=True)
class EventBatch:
    """New events of one job for all clients at the same position: encoded once, not once per client."""

    wire: bytes
    last: bool
    """True if the job has ended: no batch follows."""


@dataclass(eq=False)
class Subscription:
    """One open stream."""

    tenant: str
    key: UUID
    job: UUID
    seq: int
    loop: asyncio.AbstractEventLoop
    queue: asyncio.Queue[EventBatch | None] = field(default_factory=lambda: asyncio.Queue(QUEUE_LIMIT))

    def put(self, batch: EventBatch | None) -> None:
        """Queue a batch; called on the subscription's own loop."""
        if self.queue.full():
            self.queue.get_nowait()
            batch = CLOSED
        self.queue.put_nowait(batch)


class EventBroadcaster:
    """Reads new events of followed jobs, once for all their clients."""

    def __init__(self, engine: sa.Engine, url: str, words: Callable[[EventRow], bytes]) -> None:
        """Set the connection and `words`, the encoder of an event for its streams."""
        self._engine = engine
        self._url = url
        self._words = words
        self._lock = threading.Lock()
        self._subscriptions: dict[UUID, set[Subscription]] = defaultdict(set)
        self._due: dict[UUID, float] = {}
        self._read: dict[UUID, float] = {}
        self._keys_due = 0.0
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="broadcaster", daemon=True)

    def start(self) -> None:
        """Start listening."""
        self._thread.start()

    def stop(self) -> None:
        """Close every stream and stop."""
        self._stopping.set()
        with self._lock:
            _tell((s, CLOSED) for all_of_job in self._subscriptions.values() for s in all_of_job)
        self._thread.join(timeout=5)

    @contextlib.asynccontextmanager
    async def follow(self, key: ApiKey, job: UUID, seq: int) -> AsyncIterator[Subscription]:
        """Subscribe to a job's events with a greater `seq`; existing ones come first. The subscription is closed within
        seconds after the key becomes invalid or the tenant is suspended."""
        subscription = Subscription(key.tenant, key.id, job, seq, asyncio.get_running_loop())
        with self._lock:
            self._subscriptions[job].add(subscription)
            self._due[job] = 0.0
        try:
            yield subscription
        finally:
            with self._lock:
                self._subscriptions[job].discard(subscription)
                if not self._subscriptions[job]:
                    for table in (self._subscriptions, self._due, self._read):
                        table.pop(job, None)

    def _run(self) -> None:
        while not self._stopping.is_set():
            try:
                with Listener(self._url, (EVENT_CHANNEL,)) as listener:
                    self._mark_all()  # notifications sent while not listening
                    while not self._stopping.is_set():
                        self._mark(n.payload for n in listener.wait(WAIT))
                        self._mark_old()
                        self._read_due()
                        self._close_invalid()
            except Unreachable as error:
                log.warning("tailer_disconnected", error=error.message)
                self._stopping.wait(RECONNECT_SECONDS)
            except InvalidInput as error:  # a pooler was added since the start
                log.error("tailer_refused", error=str(error))
                self._stopping.wait(REFUSED_SECONDS)
            except Exception:
                log.exception("tailer_failed")
                self._stopping.wait(1.0)

    def _mark_all(self) -> None:
        with self._lock:
            for job in self._subscriptions:
                self._due[job] = 0.0

    def _mark_old(self) -> None:
        old = time.monotonic() - REREAD_SECONDS
        with self._lock:
            for job in self._subscriptions:
                if self._read.get(job, 0.0) <= old:
                    self._due.setdefault(job, 0.0)

    def _mark(self, payloads: Iterator[str]) -> None:
        with self._lock:
            for payload in payloads:
                job = UUID(payload)
                if job in self._subscriptions:
                    self._due.setdefault(job, self._read.get(job, 0.0) + PERIOD)

    def _read_due(self) -> None:
        now = time.monotonic()
        with self._lock:
            due = [job for job, at in self._due.items() if at <= now]
            for job in due:
                del self._due[job]
                self._read[job] = now
        for job in due:
            try:
                self._feed(job)
            except Unreachable:
                with self._lock:
                    if job in self._subscriptions:
                        self._due[job] = now
                raise

    def _close_invalid(self) -> None:
        """Close subscriptions whose key was revoked or has expired, or whose tenant is suspended."""
        now = time.monotonic()
        if now < self._keys_due:
            return
        self._keys_due = now + KEY_SECONDS
        with self._lock:
            followers = [follower for of_job in self._subscriptions.values() for follower in of_job]
        if not followers:
            return
        with transaction(self._engine) as conn:
            valid = keys_still_valid(conn, {follower.key for follower in followers})
        _tell((follower, CLOSED) for follower in followers if follower.key not in valid)

    def _feed(self, job: UUID) -> None:
        with self._lock:
            followers = list(self._subscriptions.get(job, ()))
        if not followers:
            return
        seq = min(s.seq for s in followers)
        try:
            with transaction(self._engine) as conn:
                events: list[EventRow] = []
                while page := events_after(conn, followers[0].tenant, job, events[-1].seq if events else seq):
                    events.extend(page)
        except NotFound:  # job deleted
            _tell((follower, CLOSED) for follower in followers)
            return
        if not events:
            return
        batches: dict[int, EventBatch] = {}
        behind = [follower for follower in followers if follower.seq < events[-1].seq]
        for seq in {follower.seq for follower in behind}:
            new = last_progress_only([event for event in events if event.seq > seq])
            wire = b"".join(map(self._words, new))
            batches[seq] = EventBatch(wire, last=new[-1].data.get("state") in ENDED)
        _tell([(follower, batches[follower.seq]) for follower in behind])
        for follower in behind:
            follower.seq = events[-1].seq


def _tell(deliveries: Iterable[tuple[Subscription, EventBatch | None]]) -> None:
    """Pass batches to the loops of the streams; each loop is woken once, however many of its streams get one."""
    by_loop: dict[asyncio.AbstractEventLoop, list[tuple[Subscription, EventBatch | None]]] = defaultdict(list)
    for subscription, batch in deliveries:
        by_loop[subscription.loop].append((subscription, batch))
    for loop, pairs in by_loop.items():
        with contextlib.suppress(RuntimeError):  # the loop is closed, and its streams with it
            loop.call_soon_threadsafe(_put_all, pairs)


def _put_all(pairs: list[tuple[Subscription, EventBatch | None]]) -> None:
    for subscription, batch in pairs:
        subscription.put(batch)


def last_progress_only(events: list[EventRow]) -> list[EventRow]:
    """Drop progress events that a later one in the list makes stale."""
    last = max((e.seq for e in events if e.kind == PROGRESS), default=None)
    return [event for event in events if event.kind != PROGRESS or event.seq == last]
