"""The committer thread: exports, stores and commits the results of one batch while the next one runs."""

from __future__ import annotations

import hashlib
import queue
import threading
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TypeAlias
from uuid import UUID

import sqlalchemy as sa

from marey.core.errors import MareyError, Unreachable
from marey.db import transaction
from marey.evaluations import NewScore, commit_score
from marey.jobs import (
    AssetDigest,
    Committed,
    FailureReason,
    ItemFailure,
    NewMotion,
    NewText,
    asset_key,
    begin_assets,
    commit_motions,
    commit_texts,
    fail_items,
    release,
)
from marey.runtime.export_types import Export, ExportedFile
from marey.runtime.faults import as_problem, retry_unreachable
from marey.runtime.handler import Done, Failed, Outcome, Scored, TextDone
from marey.runtime.lease import Heartbeat, HeldLease
from marey.runtime.logs import logger
from marey.runtime.telemetry import ids_of
from marey.storage import AssetStore, NewObject

log = logger(__name__)

GROUP = 64  # maximum outcomes per transaction: a commit costs an fsync and the lock of its job row
GROUP_SECONDS = 2.0  # limits the loss when a child is killed
STORE_PATIENCE = 60.0  # seconds; covers a restart of the store, after that the items are released
DATABASE_PATIENCE = 120.0
WENT = {
    "motions": "succeeded",
    "score": "succeeded",
    "texts": "parsed",
    "failures": "failed",
    "release": "released",
}
"""States after a write that does not report them itself, as metric labels."""


@dataclass(frozen=True)
class _Finish:
    """The handler is done with this lease; `reason` says why items without an outcome are released."""

    reason: str


_Files: TypeAlias = tuple[tuple[ExportedFile, AssetDigest], ...]


@dataclass(frozen=True)
class _Exported:
    item: UUID
    export: Export
    elapsed: float
    files: _Files


_Result: TypeAlias = _Exported | TextDone | Scored | Failed


class Committer(threading.Thread):
    """Queues outcomes and writes them. Every write is fenced; lost results are discarded.

    A stopping worker does not wait: after one more try, unwritten items are released.

    At most two leases are active, one running and one being stored; `acquire_slot` waits until that holds.
    """

    def __init__(self, engine: sa.Engine, store: AssetStore, heartbeat: Heartbeat, stopping: threading.Event) -> None:
        super().__init__(name="committer", daemon=True)
        self._engine = engine
        self._store = store
        self._heartbeat = heartbeat
        self._stopping = stopping
        self._inbox: queue.SimpleQueue[tuple[HeldLease, Outcome | _Finish] | None] = queue.SimpleQueue()
        self._held_back: tuple[HeldLease, Outcome | _Finish] | None = None
        self._slots = threading.Semaphore(2)
        self._idle = threading.Condition()
        self._pending = 0

    # --- the loop's side ---

    def acquire_slot(self) -> None:
        """Wait until another lease may be claimed."""
        self._slots.acquire()
        with self._idle:
            self._pending += 1

    def release_slot(self) -> None:
        """Release a slot for which there was nothing to claim."""
        with self._idle:
            self._pending -= 1
            self._idle.notify_all()
        self._slots.release()

    def put(self, lease: HeldLease, outcome: Outcome) -> None:
        """Queue one outcome."""
        self._inbox.put((lease, outcome))

    def finish(self, lease: HeldLease, reason: str) -> None:
        """End the outcomes of this lease: items without one are released uncounted, with `reason`."""
        lease.hand_over()
        self._inbox.put((lease, _Finish(reason)))

    def wait_until_idle(self, timeout: float) -> bool:
        """Return True if everything queued was written within `timeout` seconds."""
        with self._idle:
            return self._idle.wait_for(lambda: self._pending == 0, timeout)

    def close(self) -> None:
        """End the thread after its queue is empty."""
        self._inbox.put(None)

    # --- the thread's side ---

    def run(self) -> None:
        while (message := self._next()) is not None:
            lease, first = message
            lease.take_up()
            with lease.telemetry.bound():
                self._take(lease, first)
            if isinstance(first, _Finish):
                lease.telemetry.end()
                self._heartbeat.let_go(lease)
                self.release_slot()

    def _take(self, lease: HeldLease, first: Outcome | _Finish) -> None:
        try:
            if isinstance(first, _Finish):
                self._give_back(lease, lease.open, first.reason)
            else:
                self._write_or_fail(lease, self._group(lease, first))
        except Exception as error:  # the thread must survive; unwritten items run again when the lease is swept
            problem = as_problem(error)
            log.exception("not_written", error=problem.problem_type)

    def _next(self) -> tuple[HeldLease, Outcome | _Finish] | None:
        message, self._held_back = self._held_back, None
        return message if message is not None else self._inbox.get()

    def _group(self, lease: HeldLease, first: Outcome) -> list[_Result]:
        """Collect `first` and the queued outcomes of the same lease, exported, within bounds."""
        until = time.monotonic() + GROUP_SECONDS
        group = [self._export(lease, first)]
        while len(group) < GROUP and time.monotonic() < until:
            try:
                message = self._inbox.get_nowait()
            except queue.Empty:
                break
            if message is None or message[0] is not lease or isinstance(message[1], _Finish):
                if message is None:
                    self._inbox.put(None)
                self._held_back = message
                break
            group.append(self._export(lease, message[1]))
        return [outcome for outcome in group if outcome is not None]

    def _export(self, lease: HeldLease, outcome: Outcome) -> _Result | None:
        """Make the files of a `Done`; None if the result is no longer wanted."""
        if outcome.item in lease.lost:
            return None
        if not isinstance(outcome, Done):
            return outcome
        try:
            with lease.telemetry.stage("export", item=outcome.item):
                export = outcome.export()
        except MareyError as error:
            return Failed(outcome.item, error, retryable=isinstance(error, Unreachable))
        except Exception as error:
            log.exception("export_failed", item=str(outcome.item))
            return Failed(outcome.item, as_problem(error), retryable=True)
        finally:
            lease.progress(0, 0)
        return _Exported(outcome.item, export, outcome.elapsed, _digested(export.files))

    def _write_or_fail(self, lease: HeldLease, group: Sequence[_Result]) -> None:
        """Write a group; a bug costs the items an attempt, so that it cannot repeat for ever."""
        try:
            self._write(lease, group)
        except Unreachable:
            raise  # released when the lease is finished
        except Exception as error:
            log.exception("write_failed", items=len(group), item_ids=ids_of(outcome.item for outcome in group))
            problem = FailureReason.of(as_problem(error))
            failures = [ItemFailure(outcome.item, problem, retryable=True) for outcome in group]
            lease.settle(outcome.item for outcome in group)
            self._commit(lease, "failures", lambda conn, token: fail_items(conn, token, failures))

    def _write(self, lease: HeldLease, group: Sequence[_Result]) -> None:
        motions = [outcome for outcome in group if isinstance(outcome, _Exported)]
        if motions:
            self._write_motions(lease, motions)
        for score in (outcome for outcome in group if isinstance(outcome, Scored)):
            self._write_score(lease, score)
        texts = [NewText(o.item, o.key, o.blob, o.scope) for o in group if isinstance(o, TextDone)]
        if texts:
            self._commit(lease, "texts", lambda conn, token: commit_texts(conn, token, texts))
        failures = [
            ItemFailure(o.item, FailureReason.of(o.problem), o.retryable) for o in group if isinstance(o, Failed)
        ]
        if failures:
            self._commit(lease, "failures", lambda conn, token: fail_items(conn, token, failures))

    def _write_motions(self, lease: HeldLease, motions: Sequence[_Exported]) -> None:
        if not self._store_files(lease, [m.item for m in motions], [file for m in motions for file in m.files]):
            return
        rows = [
            NewMotion(
                item=motion.item,
                files={file.format: digest for file, digest in motion.files},
                frames=motion.export.frames,
                fps=motion.export.fps,
                licence=motion.export.licence,
                elapsed=motion.elapsed,
                metadata=motion.export.manifest,
            )
            for motion in motions
        ]
        self._commit(lease, "motions", lambda conn, token: commit_motions(conn, token, rows))

    def _write_score(self, lease: HeldLease, score: Scored) -> None:
        files = _digested(score.files)
        if not self._store_files(lease, [score.item], files):
            return
        reports = {file.format: digest for file, digest in files}
        row = NewScore(score.item, reports, score.summary, score.regressed, score.reason)
        self._commit(lease, "score", lambda conn, token: commit_score(conn, token, row))

    def _store_files(
        self, lease: HeldLease, items: Sequence[UUID], files: Sequence[tuple[ExportedFile, AssetDigest]]
    ) -> bool:
        """Announce and upload the files of these items; return False if they were lost or released."""
        digests = list({digest.sha256: digest for _, digest in files}.values())
        token = lease.claim.lease_token

        def announce() -> bool:
            with transaction(self._engine) as conn:
                return begin_assets(conn, token, digests)

        if not retry_unreachable(announce, seconds=DATABASE_PATIENCE, stopping=self._stopping):
            lease.settle(items)
            lease.telemetry.wrote((), lost=len(items))
            log.info("results_thrown_away", items=len(items), item_ids=ids_of(items))
            return False
        left = {asset_key(lease.claim.tenant, digest.sha256): file for file, digest in files}

        def put() -> None:
            objects = [NewObject(key, file.content, file.media_type) for key, file in left.items()]
            for key in self._store.put_all(objects):
                del left[key]
                lease.progress(0, 0)

        try:
            with lease.telemetry.stage("store", items=items):
                retry_unreachable(put, seconds=STORE_PATIENCE, stopping=self._stopping)
        except Unreachable as error:
            lease.telemetry.outage()
            log.error("store_away", items=len(items), error=error.message)
            self._give_back(lease, items, "the asset store does not answer")
            return False
        return True

    def _commit(self, lease: HeldLease, what: str, write: Callable[[sa.Connection, UUID], Committed]) -> None:
        def attempt() -> Committed:
            with transaction(self._engine) as conn:
                return write(conn, lease.claim.lease_token)

        # A commit whose answer was lost is repeated: its items then count as `lost`, but their rows are written.
        with lease.telemetry.stage("commit") as span:
            committed = retry_unreachable(attempt, seconds=DATABASE_PATIENCE, stopping=self._stopping)
            span.set(what=what, items=len(committed.items), item=",".join(ids_of(committed.items)))
        lease.settle([*committed.items, *committed.lost])
        lease.telemetry.wrote(
            (committed.states.get(item, WENT[what]) for item in committed.items), lost=len(committed.lost)
        )
        for item, state in committed.states.items():
            log.warning("item_not_made", item=str(item), state=state)
        log.info("committed", what=what, items=len(committed.items), thrown_away=len(committed.lost))

    def _give_back(self, lease: HeldLease, items: Iterable[UUID], reason: str) -> None:
        open_items = [item for item in items if item in lease.open]
        if open_items:
            self._commit(lease, "release", lambda conn, token: release(conn, token, reason, open_items))


def _digested(files: Sequence[ExportedFile]) -> _Files:
    return tuple(
        (file, AssetDigest(hashlib.sha256(file.content).hexdigest(), len(file.content), file.media_type))
        for file in files
    )
