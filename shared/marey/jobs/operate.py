"""Operator actions on a job. Each takes the tenant, writes an event with its reason, and returns the job."""

from __future__ import annotations

from dataclasses import replace
from uuid import UUID

import sqlalchemy as sa

from marey.core.errors import Conflict, InvalidInput
from marey.db.database import QUEUE_CHANNEL
from marey.db.sql import CLOCK, notify
from marey.jobs import tables
from marey.jobs.journal import LockedJob, NewEvent, change_lanes, lock_job_of, record, returned
from marey.jobs.listings import get_job
from marey.jobs.states import ENDED, OPEN, RETRYABLE, Cause, ItemState, JobControl
from marey.jobs.submit import check_share
from marey.jobs.types import EDIT_QUEUE, EVALUATOR_QUEUE, NO_TEXT, PRIORITY_LIMIT, JobRow
from marey.tenants.quotas import reserve_quotas


def pause(conn: sa.Connection, tenant: str, job: UUID, reason: str = "paused by operator") -> JobRow:
    """Stop claiming items of this job; leased items finish. Paused already: no change.

    Raises:
        NotFound: the tenant has no such job.
        Conflict: the job has ended.
    """
    locked = lock_job_of(conn, tenant, job)
    _refuse_ended(locked, "paused")
    if locked.control is not JobControl.PAUSED:
        record(conn, locked, [NewEvent("paused", reason)], control=JobControl.PAUSED)
    return get_job(conn, tenant, job)


def resume(conn: sa.Connection, tenant: str, job: UUID, reason: str = "resumed by operator") -> JobRow:
    """Continue a paused job. Running already: no change.

    Raises:
        NotFound: the tenant has no such job.
        Conflict: the job has ended.
    """
    locked = lock_job_of(conn, tenant, job)
    _refuse_ended(locked, "resumed")
    if locked.control is not JobControl.RUN:
        record(conn, locked, [NewEvent("resumed", reason)], control=JobControl.RUN)
        lane = tables.lane.c
        waiting = sa.select(lane.queue).where(lane.job_id == job, lane.ready + lane.solo > 0).distinct()
        notify(conn, QUEUE_CHANNEL, conn.execute(waiting).scalars().all())
    return get_job(conn, tenant, job)


def cancel(conn: sa.Connection, tenant: str, job: UUID, reason: str = "cancelled by operator") -> JobRow:
    """Cancel every open item and take leases away; workers learn it within a second. Ended already: no change.

    Raises:
        NotFound: the tenant has no such job.
    """
    locked = lock_job_of(conn, tenant, job)
    if locked.state not in ENDED:
        cancel_open_items(conn, locked, Cause.OPERATOR, reason, control=JobControl.CANCELLED)
    return get_job(conn, tenant, job)


def retry(
    conn: sa.Connection, tenant: str, job: UUID, *, failed_only: bool = False, reason: str = "retried by operator"
) -> JobRow:
    """Send failed, dead and (unless `failed_only`) cancelled items back to ready, with no attempts used.

    Raises:
        NotFound: the tenant has no such job.
        Conflict: no item can be retried, or the prompts were erased.
        QuotaUsedUp: the tenant's quotas have no room for them.
    """
    locked = lock_job_of(conn, tenant, job)
    refuse_erased(locked, "retried")
    wanted = RETRYABLE - {ItemState.CANCELLED} if failed_only else RETRYABLE
    moved = {(state, ItemState.READY): getattr(locked, state) for state in wanted if getattr(locked, state)}
    if not moved:
        raise Conflict(
            "no item of this job can be retried",
            where=f"job {job}",
            hint=f"Items that are {', '.join(sorted(wanted))} can.",
        )
    reserve_quotas(conn, tenant, sum(moved.values()))
    table = tables.item
    ours = (table.c.job_id == job) & table.c.state.in_(sorted(wanted))
    _refuse_unread(conn, job, ours)
    rows = conn.execute(
        sa.update(table)
        .where(ours)
        .values(
            state=ItemState.READY,
            attempts=0,
            solo=False,
            problem=None,
            finished_at=None,
            reason=f"{Cause.OPERATOR}: {reason}",
        )
        .returning(table.c.queue, table.c.batch_key)
    ).all()
    change_lanes(conn, job, returned((row.queue, row.batch_key, False) for row in rows))
    # Cancelled or ended jobs continue; the pause of a job with open items stays.
    control = JobControl.RUN if locked.state in ENDED else None
    record(conn, locked, [NewEvent("retried", reason, data={"items": len(rows)})], moved=moved, control=control)
    return get_job(conn, tenant, job)


def set_priority(conn: sa.Connection, tenant: str, job: UUID, priority: int, reason: str = "set by operator") -> JobRow:
    """Set the job's priority among its tenant's jobs, −1000 … 1000, higher first.

    Raises:
        NotFound: the tenant has no such job.
        InvalidInput: out of range.
    """
    if not -PRIORITY_LIMIT <= priority <= PRIORITY_LIMIT:
        raise InvalidInput(f"{priority} is not between -{PRIORITY_LIMIT} and {PRIORITY_LIMIT}", where="priority")
    locked = lock_job_of(conn, tenant, job)
    conn.execute(sa.update(tables.job).where(tables.job.c.id == job).values(priority=priority))
    record(conn, locked, [NewEvent("priority", f"priority {priority}: {reason}", data={"priority": priority})])
    return get_job(conn, tenant, job)


def set_fail_early(
    conn: sa.Connection, tenant: str, job: UUID, share: float | None, reason: str = "set by operator"
) -> JobRow:
    """Set the failure ratio above which open items are cancelled; applied at once. None = never.

    Raises:
        NotFound: the tenant has no such job.
        InvalidInput: not between 0 and 1.
    """
    check_share(share)
    locked = replace(lock_job_of(conn, tenant, job), fail_early=share)
    conn.execute(sa.update(tables.job).where(tables.job.c.id == job).values(fail_early=share))
    summary = "never fails early" if share is None else f"fails early above a share of {share:g}"
    cancel_if_failing(
        conn, record(conn, locked, [NewEvent("fail_early", f"{summary}: {reason}", data={"share": share})])
    )
    return get_job(conn, tenant, job)


def set_comment(conn: sa.Connection, tenant: str, job: UUID, comment: str | None) -> JobRow:
    """Write or remove the comment.

    Raises:
        NotFound: the tenant has no such job.
    """
    locked = lock_job_of(conn, tenant, job)
    conn.execute(sa.update(tables.job).where(tables.job.c.id == job).values(comment=comment))
    record(conn, locked, [NewEvent("comment", comment or "comment removed")])
    return get_job(conn, tenant, job)


def cancel_open_items(
    conn: sa.Connection, job: LockedJob, cause: Cause, reason: str, *, control: JobControl | None
) -> None:
    """Cancel ready and leased items of a locked job; its leases end."""
    table = tables.item
    conn.execute(
        sa.update(table)
        .where(table.c.job_id == job.id, table.c.state.in_(sorted(OPEN)))
        .values(
            state=ItemState.CANCELLED,
            lease_token=None,
            run_after=None,
            finished_at=CLOCK,
            reason=f"{cause}: {reason}",
        )
    )
    conn.execute(sa.delete(tables.lease).where(tables.lease.c.job_id == job.id))
    moved = {(ItemState.READY, ItemState.CANCELLED): job.ready, (ItemState.LEASED, ItemState.CANCELLED): job.leased}
    event = NewEvent("cancelled", reason, data={"items": job.ready + job.leased, "cause": cause})
    record(conn, job, [event], moved=moved, control=control)


def cancel_if_failing(conn: sa.Connection, job: LockedJob) -> None:
    """Cancel open items of a locked job once its failure ratio exceeds `fail_early` (off by default)."""
    broken = job.failed + job.dead
    if job.fail_early is None or broken <= job.fail_early * job.total or job.ready + job.leased == 0:
        return
    reason = f"{broken} of {job.total} items failed, more than the share of {job.fail_early:g} allowed"
    cancel_open_items(conn, job, Cause.FAIL_EARLY, reason, control=None)


def refuse_erased(job: LockedJob, verb: str) -> None:
    """Validate that the job's prompts still exist.

    Raises:
        Conflict: they were erased.
    """
    if job.erased:
        raise Conflict(
            f"the job's prompts were erased, so it cannot be {verb}",
            where=f"job {job.id}",
            hint="Submit the prompts again as a new job.",
        )


def _refuse_unread(conn: sa.Connection, job: UUID, items: sa.ColumnElement[bool]) -> None:
    """Validate that no item lacks text features. A backup holds none, so a restored item could not be generated."""
    table = tables.item.c
    unread = items & (table.text_key == NO_TEXT) & table.model.not_in((EDIT_QUEUE, EVALUATOR_QUEUE))
    if conn.execute(sa.select(table.id).where(unread).limit(1)).one_or_none() is not None:
        raise Conflict(
            "items of this job came from a backup, and cannot be retried",
            where=f"job {job}",
            hint="Submit their prompts again as a new job.",
        )


def _refuse_ended(job: LockedJob, verb: str) -> None:
    if job.state in ENDED:
        raise Conflict(
            f"the job is {job.state} and cannot be {verb}",
            where=f"job {job.id}",
            hint="`marey jobs retry` starts its failed, dead and cancelled items again.",
        )
