"""The job row: its lock, counters and events. Every change of an item goes through `record`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any
from uuid import UUID

import sqlalchemy as sa
from sqlalchemy.dialects.postgresql import insert

from marey.core.errors import NotFound
from marey.db.database import EVENT_CHANNEL, QUEUE_CHANNEL
from marey.db.sql import CLOCK, notify
from marey.jobs import tables
from marey.jobs.notifications import enqueue_job_event
from marey.jobs.states import ENDED, ItemState, JobControl, JobState, job_state
from marey.vocabulary.scope import ScopePolicy

Lane = tuple[str, str]
"""Queue and batch key."""


@dataclass(frozen=True)
class LockedJob:
    """A locked job row."""

    id: UUID
    tenant: str
    control: JobControl
    fail_early: float | None
    started: bool
    total: int
    ready: int
    leased: int
    succeeded: int
    failed: int
    dead: int
    cancelled: int
    erased: bool = False
    """True if its prompts were erased: its items cannot be made again."""
    traceparent: str | None = None
    scope: ScopePolicy = "ignore"

    @property
    def state(self) -> JobState:
        """Value of the column of that name."""
        return job_state(self.control, self, started=self.started)

    def counters(self) -> dict[str, int]:
        """Items by state, and `total`."""
        return {"total": self.total} | {str(state): getattr(self, state) for state in ItemState}


@dataclass(frozen=True)
class NewEvent:
    """An event to write; counters and state are added."""

    kind: str
    reason: str
    item: UUID | None = None
    data: Mapping[str, object] = field(default_factory=dict[str, object])


@dataclass(frozen=True)
class LaneChange:
    """Change of a lane's counter; negative = fewer items."""

    ready: int = 0
    solo: int = 0


def lock_job(
    conn: sa.Connection, job: UUID, *, tenant: str | None = None, skip_locked: bool = False
) -> LockedJob | None:
    """Lock a job row until the transaction ends; None if there is none (or, with `skip_locked`, it is locked)."""
    table = tables.job.c
    query = sa.select(
        table.id,
        table.tenant_id.label("tenant"),
        table.control,
        table.fail_early,
        table.started_at.is_not(None).label("started"),
        table.total,
        *(table[str(state)] for state in ItemState),
        table.erased_at.is_not(None).label("erased"),
        table.traceparent,
        table.scope,
    ).where(table.id == job)
    if tenant is not None:
        query = query.where(table.tenant_id == tenant)
    # NO KEY: rows that refer to the job may be inserted meanwhile.
    row = conn.execute(query.with_for_update(key_share=True, skip_locked=skip_locked)).mappings().one_or_none()
    if row is None:
        return None
    values: dict[str, Any] = dict(row)
    values["control"] = JobControl(row["control"])
    return LockedJob(**values)


def lock_job_of(conn: sa.Connection, tenant: str, job: UUID) -> LockedJob:
    """Lock a tenant's job.

    Raises:
        NotFound: the tenant has no such job.
    """
    locked = lock_job(conn, job, tenant=tenant)
    if locked is None:
        raise no_such_job(job)
    return locked


def no_such_job(job: UUID) -> NotFound:
    """Return the error for a job that does not exist, or belongs to another tenant."""
    return NotFound("there is no such job", where=f"job {job}", hint="`marey jobs list` shows yours.")


def record(
    conn: sa.Connection,
    job: LockedJob,
    events: Sequence[NewEvent] = (),
    *,
    moved: Mapping[tuple[ItemState, ItemState], int] | None = None,
    added: int = 0,
    control: JobControl | None = None,
) -> LockedJob:
    """Write changes of a locked job: counters, control, times, numbered events, notification, and webhook events.

    Args:
        moved: number of items by transition.
        added: number of new ready items.
        events: in order. When the job's state changes an event `state` follows them.
    """
    grown = replace(job, control=control or job.control, total=job.total + added, ready=job.ready + added)
    after = _moved(grown, moved or {})
    if after.state is not job.state:
        change = NewEvent("state", f"{job.state} → {after.state}", data={"from": job.state, "to": after.state})
        events = [*events, change]
    table = tables.job
    ended = after.state in ENDED
    last = conn.execute(
        sa.update(table)
        .where(table.c.id == job.id)
        .values(
            control=after.control,
            total=after.total,
            **{str(state): getattr(after, state) for state in ItemState},
            event_seq=table.c.event_seq + len(events),
            started_at=sa.func.coalesce(table.c.started_at, CLOCK) if after.started else None,
            finished_at=sa.func.coalesce(table.c.finished_at, CLOCK) if ended else None,
        )
        .returning(table.c.event_seq)
    ).scalar_one()
    if ended:
        conn.execute(sa.delete(tables.lane).where(tables.lane.c.job_id == job.id))  # a retry creates them again
    if events:
        _write_events(conn, after, events, first=last - len(events) + 1)
    enqueue_job_event(conn, job.tenant, job.id, job.state, after.state, after.counters())
    return after


def change_lanes(conn: sa.Connection, job: UUID, changes: Mapping[Lane, LaneChange]) -> None:
    """Upsert lane counters of a locked job; NOTIFY queues that grew."""
    table = tables.lane
    gains = {lane: change for lane, change in changes.items() if change.ready >= 0 and change.solo >= 0}
    if gains:
        new = insert(table).values(
            [
                {"job_id": job, "queue": queue, "batch_key": key, "ready": change.ready, "solo": change.solo}
                for (queue, key), change in gains.items()
            ]
        )
        was_empty = table.c.ready + table.c.solo == 0
        conn.execute(
            new.on_conflict_do_update(
                index_elements=["job_id", "queue", "batch_key"],
                set_={
                    "ready": table.c.ready + new.excluded.ready,
                    "solo": table.c.solo + new.excluded.solo,
                    "waiting_since": sa.case((was_empty, CLOCK), else_=table.c.waiting_since),
                },
            )
        )
        notify(conn, QUEUE_CHANNEL, {queue for queue, _ in gains})
    for (queue, key), change in changes.items():
        if (queue, key) not in gains:
            conn.execute(
                sa.update(table)
                .where(table.c.job_id == job, table.c.queue == queue, table.c.batch_key == key)
                .values(ready=table.c.ready + change.ready, solo=table.c.solo + change.solo)
            )


def returned(items: Iterable[tuple[str, str, bool]]) -> dict[Lane, LaneChange]:
    """Return the lane changes for items (queue, batch key, solo) that become ready again."""
    counts = Counter(items)
    return {
        (queue, key): LaneChange(ready=counts[queue, key, False], solo=counts[queue, key, True])
        for queue, key, _ in counts
    }


def _moved(job: LockedJob, moved: Mapping[tuple[ItemState, ItemState], int]) -> LockedJob:
    counts = {str(state): int(getattr(job, state)) for state in ItemState}
    for (before, after), count in moved.items():
        counts[before] -= count
        counts[after] += count
    return replace(job, started=job.started or counts[ItemState.LEASED] > 0, **counts)


def _write_events(conn: sa.Connection, job: LockedJob, events: Sequence[NewEvent], *, first: int) -> None:
    common = {"counters": job.counters(), "state": job.state}
    conn.execute(
        sa.insert(tables.job_event).values(at=CLOCK),
        [
            {
                "job_id": job.id,
                "seq": seq,
                "kind": event.kind,
                "item_id": event.item,
                "reason": event.reason,
                "data": {**event.data, **common},
            }
            for seq, event in enumerate(events, first)
        ],
    )
    notify(conn, EVENT_CHANNEL, [str(job.id)])
