"""Registered workers: a row per worker, renewed by its heartbeat."""

from __future__ import annotations

import sqlalchemy as sa
from sqlalchemy.dialects.postgresql import insert

from marey.db.sql import CLOCK, interval
from marey.jobs import tables
from marey.jobs.lease_types import SchedulerRow, WorkerHeartbeat, WorkerRow
from marey.jobs.policy import Policy, policy

SCHEDULER = "scheduler"
"""Queue of the heartbeat rows of schedulers: they are not workers."""
SCHEDULER_LIVE = 30.0
"""Seconds after its last heartbeat for which a scheduler counts as working; it sends one every 5 s."""


def beat(conn: sa.Connection, worker: WorkerHeartbeat) -> None:
    """Record a worker's heartbeat."""
    values = {
        "queue": worker.queue,
        "host": worker.host,
        "pid": worker.pid,
        "device": worker.device,
        "bundle": worker.bundle,
        "batch_key": worker.batch_key,
        "seen_at": CLOCK,
    }
    conn.execute(
        insert(tables.worker)
        .values(id=worker.id, started_at=CLOCK, **values)
        .on_conflict_do_update(index_elements=["id"], set_=values)
    )


def retire(conn: sa.Connection, worker: str) -> None:
    """Remove a worker that stops gracefully."""
    conn.execute(sa.delete(tables.worker).where(tables.worker.c.id == worker))


def live_workers(conn: sa.Connection, *, rules: Policy | None = None) -> dict[str, int]:
    """Count live workers by queue."""
    table = tables.worker.c
    rows = conn.execute(
        sa.select(table.queue, sa.func.count().label("workers"))
        .where(_live(rules or policy()), table.queue != SCHEDULER)
        .group_by(table.queue)
    )
    return {row.queue: row.workers for row in rows}


def list_workers(conn: sa.Connection, *, rules: Policy | None = None) -> list[WorkerRow]:
    """Return every worker seen within a day, newest heartbeat first."""
    table = tables.worker.c
    rows = conn.execute(
        sa.select(
            *(table.id, table.queue, table.host, table.pid, table.device, table.bundle),
            table.started_at.label("started"),
            table.seen_at.label("seen"),
            _live(rules or policy()).label("live"),
        )
        .where(table.queue != SCHEDULER)
        .order_by(table.seen_at.desc(), table.id)
    )
    return [WorkerRow(**row) for row in rows.mappings()]


def record_scheduler_heartbeat(conn: sa.Connection, name: str, *, host: str, pid: int) -> None:
    """Record a scheduler's heartbeat; the first one removes silent schedulers, which it replaces."""
    table = tables.worker.c
    known = conn.execute(sa.select(table.id).where(table.id == name)).one_or_none()
    if known is None:
        silent = (table.queue == SCHEDULER) & (table.seen_at < CLOCK - interval(SCHEDULER_LIVE))
        conn.execute(sa.delete(tables.worker).where(silent))
    beat(conn, WorkerHeartbeat(name, SCHEDULER, host, pid, device=""))


def list_schedulers(conn: sa.Connection) -> list[SchedulerRow]:
    """Return every scheduler that did not stop gracefully, latest heartbeat first."""
    table = tables.worker.c
    rows = conn.execute(
        sa.select(
            *(table.id, table.host, table.pid),
            table.seen_at.label("seen"),
            sa.func.extract("epoch", CLOCK - table.seen_at).cast(sa.Float).label("silence"),
            (table.seen_at > CLOCK - interval(SCHEDULER_LIVE)).label("live"),
        )
        .where(table.queue == SCHEDULER)
        .order_by(table.seen_at.desc(), table.id)
    )
    return [SchedulerRow(**row) for row in rows.mappings()]


def has_loaded(bundle: sa.ColumnElement[str], queue: str) -> sa.ColumnElement[bool]:
    """Return the condition that a live worker of a queue has loaded a bundle, for a query on rows that name one."""
    table = tables.worker.c
    return sa.exists().where(table.queue == queue, table.bundle == bundle, _live(policy()))


def _live(rules: Policy) -> sa.ColumnElement[bool]:
    return tables.worker.c.seen_at > CLOCK - interval(rules.worker_live)
