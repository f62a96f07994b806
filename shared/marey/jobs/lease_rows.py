"""Items under a lease: locked, ended or released. The fence of every write under a lease."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from uuid import UUID

import sqlalchemy as sa

from marey.db.sql import CLOCK, among
from marey.jobs import tables
from marey.jobs.journal import LockedJob, NewEvent, change_lanes, lock_job, returned
from marey.jobs.lease_types import Committed
from marey.jobs.states import Cause, ItemState
from marey.jobs.types import FailureReason

LEASED_JOB = sa.text("SELECT job_id FROM lease WHERE token = :token")

HELD_ITEMS = sa.text("""
    SELECT id, queue, batch_key, solo, attempts, text_key, position, bundle FROM item
    WHERE lease_token = :token AND (CAST(:items AS uuid[]) IS NULL OR id = ANY(CAST(:items AS uuid[])))
    ORDER BY position
    FOR UPDATE
""")

DROP_EMPTY_LEASE = sa.text("""
    DELETE FROM lease WHERE token = :token AND NOT EXISTS (SELECT FROM item WHERE lease_token = :token)
""")


@dataclass(frozen=True)
class LeasedItem:
    """An item under a lease, its row locked."""

    id: UUID
    queue: str
    batch_key: str
    solo: bool
    attempts: int
    text_key: str
    position: int
    bundle: str


def lock_leased_items(
    conn: sa.Connection, lease_token: UUID, items: Collection[UUID] | None = None
) -> list[LeasedItem]:
    """Lock the items under a lease (only the given ones, if any), in input order. The caller holds the job's lock."""
    wanted = None if items is None else list(items)
    return [LeasedItem(*row) for row in conn.execute(HELD_ITEMS, {"token": lease_token, "items": wanted})]


def give_back(
    conn: sa.Connection,
    job: LockedJob,
    items: Sequence[LeasedItem],
    cause: Cause,
    reason: str,
    *,
    solo: bool = False,
    attempts: int = 0,
) -> None:
    """Return leased items to their lanes as ready; `solo` marks them, `attempts` are added. The caller updates
    counters."""
    table = tables.item
    values: dict[str, object] = {
        "state": ItemState.READY,
        "lease_token": None,
        "reason": f"{cause}: {reason}",
        "attempts": table.c.attempts + attempts,
    }
    if solo:
        values["solo"] = True
    conn.execute(sa.update(table).where(among(table.c.id, [item.id for item in items])).values(values))
    change_lanes(conn, job.id, returned((item.queue, item.batch_key, item.solo or solo) for item in items))


def end_dead(conn: sa.Connection, item: LeasedItem, problem: FailureReason) -> NewEvent:
    """End a leased item that has no attempts left."""
    attempts = item.attempts + 1
    end_items(conn, [item.id], ItemState.DEAD, Cause.ATTEMPTS_USED_UP, problem=document(problem), attempts=attempts)
    return NewEvent("item_dead", problem.message, item.id, {"attempts": attempts, "problem": document(problem)})


def drop_empty_lease(conn: sa.Connection, lease_token: UUID) -> None:
    """Delete a lease that has no items left."""
    conn.execute(DROP_EMPTY_LEASE, {"token": lease_token})


@dataclass(frozen=True)
class LeasedItems:
    """A job and its items under a lease, all locked."""

    job: LockedJob
    items: Mapping[UUID, LeasedItem]

    def committed(self, asked: Iterable[UUID]) -> Committed:
        """Split the requested items into written and lost ones."""
        asked = tuple(dict.fromkeys(asked))
        ours = tuple(item for item in asked if item in self.items)
        return Committed(ours, tuple(item for item in asked if item not in self.items))


def lock_lease(conn: sa.Connection, lease_token: UUID, items: Collection[UUID] | None) -> LeasedItems | None:
    """Lock the job, then its items that are still under this lease. The fence of every write."""
    job_id = conn.execute(LEASED_JOB, {"token": lease_token}).scalar_one_or_none()
    job = None if job_id is None else lock_job(conn, job_id)
    if job is None:
        return None
    return LeasedItems(job, {item.id: item for item in lock_leased_items(conn, lease_token, items)})


def end_items(conn: sa.Connection, items: Sequence[UUID], state: ItemState, cause: Cause, **more: object) -> None:
    """Move leased items to a final state. The caller updates counters."""
    values = {"state": state, "lease_token": None, "reason": str(cause), "finished_at": CLOCK} | more
    conn.execute(sa.update(tables.item).where(among(tables.item.c.id, items)).values(values))


def document(problem: FailureReason) -> dict[str, object]:
    """Return a problem as its row stores it."""
    return asdict(problem)
