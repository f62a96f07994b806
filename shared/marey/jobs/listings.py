"""Listings of jobs, items, motions and events. Cursors are opaque; a foreign one is an `InvalidInput`."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any
from uuid import UUID

import sqlalchemy as sa

from marey.db.pages import PAGE, Order, Page, cut_page, page_limit, read_cursor
from marey.db.sql import among, need_row
from marey.items.item import SPEC_FIELDS
from marey.jobs import tables
from marey.jobs.journal import no_such_job
from marey.jobs.motions import read_motions
from marey.jobs.states import ItemStage, ItemState, JobControl, JobKind, JobState, Review
from marey.jobs.types import Edits, EventRow, FailureReason, ItemRow, JobRow, MotionRow


def get_job(conn: sa.Connection, tenant: str, job: UUID) -> JobRow:
    """Return one job.

    Raises:
        NotFound: the tenant has no such job.
    """
    table = tables.job.c
    return _job(need_row(conn, _jobs().where(table.tenant_id == tenant, table.id == job), no_such_job(job)))


def list_jobs(
    conn: sa.Connection, tenant: str, *, states: Collection[JobState] = (), cursor: str | None = None, limit: int = PAGE
) -> Page[JobRow]:
    """Return jobs, newest first, optionally in the given states."""
    table = tables.job.c
    ours = table.tenant_id == tenant
    query, order = _jobs().where(ours), Order(table.created_at, table.id)
    if states:
        query = query.where(table.state.in_([str(state) for state in states]))
    return order.page(conn, query, ours, cursor, limit, _job)


def list_items(
    conn: sa.Connection,
    tenant: str,
    job: UUID,
    *,
    states: Collection[ItemState] = (),
    reviews: Collection[Review] = (),
    cursor: str | None = None,
    limit: int = 100,
) -> Page[ItemRow]:
    """Return items of a job with their motions, in input order, variants within prompt; re-rolls come last.

    Args:
        states: only items in one of these.
        reviews: only items with a motion in one of these review states.

    Raises:
        NotFound: the tenant has no such job.
    """
    get_job(conn, tenant, job)
    table = tables.item.c
    query = _items().where(table.job_id == job)
    if states:
        query = query.where(table.state.in_([str(state) for state in states]))
    if reviews:
        motion = tables.motion.c
        reviewed = motion.review.in_([str(review) for review in reviews])
        query = query.join(tables.motion, (motion.item_id == table.id) & reviewed)
    if cursor is not None:
        query = query.where(table.position > read_cursor(cursor, int))
    rows = conn.execute(query.order_by(table.position).limit(page_limit(limit) + 1)).mappings().all()
    return cut_page(_with_motions(conn, rows), limit, lambda row: str(row.position))


def items_of(conn: sa.Connection, items: Collection[UUID]) -> list[ItemRow]:
    """Return the existing ones of these items, by job and in input order. The caller checks their tenant."""
    table = tables.item.c
    query = _items().where(among(table.id, items)).order_by(table.job_id, table.position)
    return _with_motions(conn, conn.execute(query).mappings().all())


def events_after(conn: sa.Connection, tenant: str, job: UUID, seq: int = 0, limit: int = 500) -> list[EventRow]:
    """Return events of a job with a greater `seq`, in order. Without gaps: `seq` is assigned under the job's row lock.

    Raises:
        NotFound: the tenant has no such job.
    """
    get_job(conn, tenant, job)
    table = tables.job_event.c
    rows = conn.execute(
        sa.select(table.job_id, table.seq, table.kind, table.item_id, table.reason, table.data, table.at)
        .where(table.job_id == job, table.seq > seq)
        .order_by(table.seq)
        .limit(page_limit(limit))
    )
    return [EventRow(*row) for row in rows]


# --- rows ---


def _jobs() -> sa.Select[*tuple[Any, ...]]:
    table = tables.job.c
    return sa.select(
        table.id,
        table.tenant_id.label("tenant"),
        *(table.name, table.comment, table.priority, table.control, table.state, table.total),
        *(table[str(state)] for state in ItemState),
        *(table.fail_early, table.event_seq),
        table.created_at.label("created"),
        table.started_at.label("started"),
        table.finished_at.label("finished"),
        table.keep_days,
        (table.finished_at + sa.func.make_interval(0, 0, 0, table.keep_days)).label("expires"),
        table.erased_at.label("erased"),
        table.scope,
        table.kind,
    )


def _job(row: sa.RowMapping) -> JobRow:
    values: dict[str, Any] = dict(row)
    values.update(control=JobControl(row["control"]), state=JobState(row["state"]), kind=JobKind(row["kind"]))
    return JobRow(**values)


def _items() -> sa.Select[*tuple[Any, ...]]:
    table = tables.item.c
    return sa.select(
        *(table.id, table.job_id.label("job"), table.position, table.index, table.variant),
        *(table.model, table.bundle, table.seed, table.settings, table.stage, table.state),
        *(table[name] for name in SPEC_FIELDS),
        *(table.attempts, table.solo, table.run_after, table.reason, table.problem, table.replaces, table.scope),
        table.edits,
        table.created_at.label("created"),
        table.finished_at.label("finished"),
    )


def _with_motions(conn: sa.Connection, rows: Sequence[sa.RowMapping]) -> list[ItemRow]:
    made = [row["id"] for row in rows if row["state"] == ItemState.SUCCEEDED]
    by_item = {motion.item: motion for motion in read_motions(conn, among(tables.motion.c.item_id, made))}
    return [_item(row, by_item.get(row["id"])) for row in rows]


def _item(row: sa.RowMapping, motion: MotionRow | None) -> ItemRow:
    values: dict[str, Any] = dict(row)
    problem = row["problem"]
    values.update(
        stage=ItemStage(row["stage"]),
        state=ItemState(row["state"]),
        tags=tuple(row["tags"]),
        problem=None if problem is None else FailureReason(**problem),
        edits=Edits.of(row["edits"]),
        motion=motion,
    )
    return ItemRow(**values)
