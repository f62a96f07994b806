"""The sweeper: transitions driven by time."""

from __future__ import annotations

from dataclasses import fields
from uuid import UUID

import sqlalchemy as sa

from marey.db.database import transaction
from marey.db.deadlines import BULK
from marey.db.sql import CLOCK, interval
from marey.jobs import tables
from marey.jobs.journal import LockedJob, NewEvent, change_lanes, lock_job, record, returned
from marey.jobs.lease_rows import drop_empty_lease, end_dead, give_back, lock_leased_items
from marey.jobs.lease_types import SweepReport
from marey.jobs.operate import cancel_if_failing
from marey.jobs.policy import Policy, policy
from marey.jobs.states import Cause, ItemState
from marey.jobs.types import FailureReason
from marey.tenants import tables as tenant_tables
from marey.webhooks.deliveries import forget_events


def sweep(engine: sa.Engine, *, rules: Policy | None = None) -> SweepReport:
    """Reclaim expired leases, make due items ready, and delete old idempotency rows, workers, webhook events and audit
    rows.

    An item of a lost lease is marked `solo`: it is claimed alone next time, and only the loss of a lease it was
    alone in counts as an attempt. Safe to run in several processes; each job is a transaction of its own.

    Raises:
        Unreachable: the database does not answer.
    """
    rules = rules or policy()
    total = SweepReport()
    lease = tables.lease.c
    with transaction(engine) as conn:
        expired = conn.execute(sa.select(lease.job_id).where(lease.expires_at < CLOCK).distinct()).scalars().all()
    for job in expired:
        with transaction(engine) as conn:
            total = _added(total, _take_back(conn, job, rules))
    total = _added(total, SweepReport(items_due=make_due(engine)))
    with transaction(engine, BULK) as conn:
        return _added(total, SweepReport(stale_assets=_tidy(conn, rules)))


def make_due(engine: sa.Engine) -> int:
    """Make items ready whose retry delay is over; return their number. Part of `sweep`.

    Raises:
        Unreachable: the database does not answer.
    """
    item = tables.item.c
    with transaction(engine) as conn:
        due = conn.execute(sa.select(item.job_id).where(item.run_after <= CLOCK).distinct()).scalars().all()
    items = 0
    for job in due:
        with transaction(engine, BULK) as conn:
            items += _make_due_ready(conn, job)
    return items


def _take_back(conn: sa.Connection, job_id: UUID, rules: Policy) -> SweepReport:
    """Reclaim the expired leases of one job."""
    job = lock_job(conn, job_id)
    report = SweepReport()
    if job is None:
        return report
    lease = tables.lease.c
    expired = conn.execute(  # checked again under lock: a heartbeat may have arrived in between
        sa.select(lease.token, lease.worker, lease.solo)
        .where(lease.job_id == job_id, lease.expires_at < CLOCK)
        .order_by(lease.token)
        .with_for_update()
    ).all()
    for token, worker, solo in expired:
        job, lost = _lose(conn, job, token, worker, rules, solo=solo)
        report = _added(report, lost)
    cancel_if_failing(conn, job)
    return report


def _lose(
    conn: sa.Connection, job: LockedJob, token: UUID, worker: str, rules: Policy, *, solo: bool
) -> tuple[LockedJob, SweepReport]:
    items = lock_leased_items(conn, token)
    dead = [item for item in items if solo and item.attempts + 1 >= rules.max_attempts]
    back = [item for item in items if item not in dead]
    reason = f"worker {worker} was lost"
    events = [NewEvent("lease_lost", reason, data={"worker": worker, "items": len(items), "solo": solo})]
    if back:
        give_back(conn, job, back, Cause.LEASE_LOST, reason, solo=True, attempts=1 if solo else 0)
    for item in dead:
        problem = FailureReason(
            "worker-lost",
            f"the worker was lost {item.attempts + 1} times while it ran this item alone",
            where=f"position {item.position}",
            hint="The item crashes its worker or takes longer than its lease; see the worker's log.",
        )
        events.append(end_dead(conn, item, problem))
    moved = {(ItemState.LEASED, ItemState.READY): len(back), (ItemState.LEASED, ItemState.DEAD): len(dead)}
    after = record(conn, job, events, moved=moved)
    drop_empty_lease(conn, token)
    return after, SweepReport(leases_lost=1, items_returned=len(back), items_dead=len(dead))


def _make_due_ready(conn: sa.Connection, job_id: UUID) -> int:
    job = lock_job(conn, job_id)
    if job is None:
        return 0
    table = tables.item
    rows = conn.execute(
        sa.update(table)
        .where(table.c.job_id == job_id, table.c.run_after <= CLOCK)
        .values(run_after=None)
        .returning(table.c.queue, table.c.batch_key, table.c.solo)
    ).all()
    change_lanes(conn, job_id, returned((row.queue, row.batch_key, row.solo) for row in rows))
    return len(rows)


def _tidy(conn: sa.Connection, rules: Policy) -> int:
    """Delete old rows; return the number of stale assets (their removal needs the store: `remove_stale_assets`)."""
    keys, workers, assets, audits = tables.idempotency, tables.worker, tables.asset, tenant_tables.audit_event
    conn.execute(sa.delete(keys).where(keys.c.created_at < CLOCK - interval(rules.idempotency)))
    conn.execute(sa.delete(workers).where(workers.c.seen_at < CLOCK - interval(rules.worker_kept)))
    forget_events(conn)
    conn.execute(sa.delete(audits).where(audits.c.at < CLOCK - interval(rules.audit_kept)))
    return conn.execute(
        sa.select(sa.func.count())
        .select_from(assets)
        .where(
            assets.c.state == "writing",
            assets.c.announced_at < CLOCK - interval(rules.asset_grace),
            ~sa.exists().where(tables.asset_writer.c.asset_id == assets.c.id),
        )
    ).scalar_one()


def _added(one: SweepReport, other: SweepReport) -> SweepReport:
    return SweepReport(*(getattr(one, name.name) + getattr(other, name.name) for name in fields(SweepReport)))
