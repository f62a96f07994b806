"""The claim loop: claim, split into buckets, run, hand over; until no work is left, the time is up or a stop comes."""

from __future__ import annotations

import os
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import NoReturn, TypeVar
from uuid import UUID

import sqlalchemy as sa

from marey.core.errors import MareyError, Unreachable
from marey.db import transaction
from marey.jobs import EDIT_QUEUE, NO_TEXT, Claim, ClaimedItem, ItemStage, claim, load_texts
from marey.runtime.committer import Committer
from marey.runtime.editing import edit_input
from marey.runtime.faults import HandlerError, as_problem, is_device_lost, is_out_of_memory, retry_unreachable
from marey.runtime.handler import Batch, Failed, Handler
from marey.runtime.lease import Heartbeat, HeldLease
from marey.runtime.logs import logger
from marey.runtime.scoring import score_input
from marey.runtime.telemetry import ids_of
from marey.storage import AssetStore

log = logger(__name__)

T = TypeVar("T")

STOP_PATIENCE = 20.0  # of the 25 s a worker has to stop
WRITE_PATIENCE = 300.0  # longer than the committer's own retries with store and database together
OUTAGE_PAUSE = 5.0  # seconds; delay before retrying an unreachable dependency
CLAIM_PATIENCE = 30.0  # seconds without a database until a drain gives up; the next hint starts another


@dataclass(frozen=True)
class LoadedBundle:
    """State of a handler: loaded bundle and last served lane."""

    bundle: str
    batch_key: str


def end_child() -> NoReturn:
    """Crash this process: its accelerator's context is gone and every later call would fail, or a batch hangs in it.

    The parent starts another child; the lease expires as after any crash, so that an item which causes this each
    time ends as `dead` and other items do not.
    """
    os._exit(70)  # EX_SOFTWARE


class Drain:
    """Serves the queues of one child.

    Args:
        engine: the database.
        worker: name for its claims from a queue.
        handlers: by queue; served in turns, so that texts stay ahead of motions and do not delay them.
        store: source of the motions of score items and edits.
        ticked: called at each claim and step of progress: liveness is the age of the last call.
    """

    def __init__(
        self,
        engine: sa.Engine,
        worker: Callable[[str], str],
        handlers: Mapping[str, Handler],
        *,
        heartbeat: Heartbeat,
        committer: Committer,
        store: AssetStore,
        stopping: threading.Event,
        ticked: Callable[[], None],
    ) -> None:
        self._engine = engine
        self._store = store
        self._worker = worker
        self._handlers = handlers
        self._heartbeat = heartbeat
        self._committer = committer
        self._stopping = stopping
        self._ticked = ticked
        self._turns = deque(handlers)
        self.loaded: dict[str, LoadedBundle] = {}

    def drain(self, seconds: float) -> int:
        """Work until all queues are empty, `seconds` are over or a stop comes; every result is written at the end.

        Returns: how many items were claimed.

        Raises:
            Unreachable: the database stayed away for longer than `CLAIM_PATIENCE`.
        """
        until = time.monotonic() + seconds
        claimed = 0
        try:
            while not self._stopping.is_set() and time.monotonic() < until:
                items = self._one_batch()
                if not items:
                    break
                claimed += items
        finally:
            self._committer.wait_until_idle(STOP_PATIENCE if self._stopping.is_set() else WRITE_PATIENCE)
        return claimed

    def load(self, queue: str, bundle: str, batch_key: str = "") -> None:
        """Load `bundle` on the handler of `queue`, if it is not loaded.

        Raises: whatever the handler raises.
        """
        known = self.loaded.get(queue)
        if known is None or known.bundle != bundle:
            self.loaded.pop(queue, None)
            started = time.monotonic()
            self._handlers[queue].load(bundle)
            log.info("loaded", queue=queue, bundle=bundle, seconds=round(time.monotonic() - started, 2))
        self.loaded[queue] = LoadedBundle(bundle, batch_key)

    def _one_batch(self) -> int:
        self._committer.acquire_slot()
        taken: Claim | None = None
        try:
            self._ticked()
            began = time.perf_counter()
            taken = retry_unreachable(self._claim, seconds=CLAIM_PATIENCE, stopping=self._stopping)
        finally:
            if taken is None:
                self._committer.release_slot()
        if taken is None:
            return 0
        lease = self._heartbeat.hold(taken)
        lease.telemetry.claimed(time.perf_counter() - began)
        with lease.telemetry.bound():
            self._work(lease)
        return len(taken.items)

    def _work(self, lease: HeldLease) -> None:
        items = lease.claim.items
        log.info("claimed", items=len(items), solo=lease.claim.solo, item_ids=ids_of(item.id for item in items))
        reason = "the worker gave no result"
        try:
            reason = self._run_claim(lease)
        finally:
            self._committer.finish(lease, "the worker was stopped" if self._stopping.is_set() else reason)

    def _claim(self) -> Claim | None:
        for queue in list(self._turns):
            known = self.loaded.get(queue)
            with transaction(self._engine) as conn:
                taken = claim(
                    conn,
                    queue,
                    self._worker(queue),
                    self._handlers[queue].batch_size,
                    prefer_batch_key=known.batch_key if known else None,
                )
            if taken is not None:
                self._turns.remove(queue)
                self._turns.append(queue)
                return taken
        return None

    def _run_claim(self, lease: HeldLease) -> str:
        """Run every bucket of a claim; return the reason for which items without an outcome are released."""
        taken = lease.claim
        handler = self._handlers[taken.queue]
        try:
            fresh = taken.queue not in self.loaded or self.loaded[taken.queue].bundle != taken.bundle
            if fresh:
                lease.exempt()  # loading, and the compile of the first batch, are silent for minutes
            with lease.telemetry.stage("load"):
                self.load(taken.queue, taken.bundle, taken.batch_key)
                batch = self._batch(lease)
            buckets = handler.buckets(batch)
        except Unreachable as error:
            return self._pause(lease, error)
        except Exception as error:
            self._fail_all(lease, taken.items, error, retryable=not isinstance(error, MareyError))
            return "failed"
        for bucket in buckets:
            try:
                self._run_bucket(lease, handler, replace(batch, items=tuple(bucket)))
            except Unreachable as error:
                return self._pause(lease, error)
        self._ticked()
        return "the worker gave no result"

    def _pause(self, lease: HeldLease, error: Unreachable) -> str:
        lease.telemetry.outage()
        log.warning("outage", error=error.message)
        self._stopping.wait(OUTAGE_PAUSE)
        return error.message

    def _batch(self, lease: HeldLease) -> Batch:
        """Return the claim with its text features, motions to edit or motions to score; items that lack features fail,
        retryably."""
        taken = lease.claim
        if taken.stage is ItemStage.TEXT:
            return Batch(taken, taken.items, {})
        editing = None
        if any(item.edits is not None for item in taken.items):
            editing = self._patiently(partial(edit_input, self._engine, self._store, taken))
        if taken.queue == EDIT_QUEUE:
            return Batch(taken, taken.items, {}, editing=editing)
        if taken.items[0].text_key == NO_TEXT:
            score = partial(score_input, self._engine, self._store, taken.job)
            return Batch(taken, taken.items, {}, scoring=self._patiently(score))
        keys = sorted({item.text_key for item in taken.items})

        def read() -> dict[str, bytes]:
            with transaction(self._engine) as conn:
                return load_texts(conn, keys)

        features = self._patiently(read)
        missing = [item for item in taken.items if item.text_key not in features]
        if missing:
            self._fail_all(lease, missing, HandlerError("the text features of this item are gone"), retryable=True)
        items = tuple(item for item in taken.items if item.text_key in features)
        return Batch(taken, items, features, editing=editing)

    def _patiently(self, read: Callable[[], T]) -> T:
        """Read the input of a claim; retry while the database is away."""
        return retry_unreachable(read, seconds=CLAIM_PATIENCE, stopping=self._stopping)

    def _run_bucket(self, lease: HeldLease, handler: Handler, batch: Batch) -> None:
        """Run items together; on failure halve the bucket, so that one item cannot fail the others."""
        dropped = lease.dropped()
        batch = replace(batch, items=tuple(item for item in batch.items if item.id not in dropped))
        if not batch.items:
            return
        answered: set[UUID] = set()
        try:
            with lease.telemetry.stage("run", items=(item.id for item in batch.items)):
                for outcome in handler.run(batch, lease):
                    answered.add(outcome.item)
                    self._committer.put(lease, outcome)
                    self._ticked()
        except Unreachable:
            raise
        except Exception as error:
            left = [item for item in batch.items if item.id not in answered]
            if is_device_lost(error):
                log.exception("device_lost", items=len(left))
                end_child()
            if len(left) < 2 or isinstance(error, MareyError):
                self._fail_all(lease, left, error, retryable=not isinstance(error, MareyError))
                return
            log.warning("batch_halved", items=len(left), memory=is_out_of_memory(error), error=type(error).__name__)
        else:
            left = [item for item in batch.items if item.id not in answered | lease.dropped()]
            if left:
                self._fail_all(lease, left, HandlerError("the worker gave no result for this item"), retryable=True)
            return
        # Outside the except block, where the exception no longer references the large tensors.
        lease.exempt()  # new shapes may compile again
        middle = (len(left) + 1) // 2
        for half in (left[:middle], left[middle:]):
            self._run_bucket(lease, handler, replace(batch, items=tuple(half)))

    def _fail_all(self, lease: HeldLease, items: Sequence[ClaimedItem], error: Exception, *, retryable: bool) -> None:
        problem = as_problem(error)
        if problem is not error:
            log.error("handler_failed", items=len(items), item_ids=ids_of(i.id for i in items), exc_info=error)
        for item in items:
            self._committer.put(lease, Failed(item.id, problem, retryable))
