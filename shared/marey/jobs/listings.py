"""Reading: jobs, items, motions, events. Cursors are opaque; a foreign one is an `InvalidInput`."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any
from uuid import UUID

import sqlalchemy as sa

from marey.errors import NotFound
from marey.jobs import schema
from marey.jobs.files import files_of
from marey.jobs.journal import among, no_such_job
from marey.jobs.pages import Order, cursor_at, cut_page, mark_of, page_limit, read_cursor
from marey.jobs.searching import fetching_by_id, find_motions
from marey.jobs.states import ItemState, JobControl, JobState, Review, Stage
from marey.jobs.types import EventRow, ItemRow, JobRow, MotionFile, MotionFilter, MotionRow, Page, Problem

EVERYTHING = MotionFilter()


def get_job(conn: sa.Connection, tenant: str, job: UUID) -> JobRow:
    """One job.

    Raises:
        NotFound: the tenant has no such job.
    """
    table = schema.job.c
    row = conn.execute(_jobs().where(table.tenant_id == tenant, table.id == job)).mappings().one_or_none()
    if row is None:
        raise no_such_job(job)
    return _job(row)


def list_jobs(
    conn: sa.Connection, tenant: str, *, states: Collection[JobState] = (), cursor: str | None = None, limit: int = 50
) -> Page[JobRow]:
    """Jobs, newest first; of these states, if any are given."""
    table = schema.job.c
    ours = table.tenant_id == tenant
    query, order = _jobs().where(ours), Order(table.created_at, table.id)
    if states:
        query = query.where(table.state.in_([str(state) for state in states]))
    if cursor is not None:
        query = query.where(order.after(cursor, ours))
    rows = conn.execute(query.order_by(*order.by()).limit(page_limit(limit) + 1)).mappings().all()
    return cut_page([_job(row) for row in rows], limit, lambda row: mark_of(row.created, row.id))


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
    """Items of a job with their motions, in input order, variants within prompt; re-rolls come last.

    Args:
        states: only items in one of these.
        reviews: only items with a motion of which one of these was said.

    Raises:
        NotFound: the tenant has no such job.
    """
    get_job(conn, tenant, job)
    table = schema.item.c
    query = _items().where(table.job_id == job)
    if states:
        query = query.where(table.state.in_([str(state) for state in states]))
    if reviews:
        motion = schema.motion.c
        said = motion.review.in_([str(review) for review in reviews])
        query = query.join(schema.motion, (motion.item_id == table.id) & said)
    if cursor is not None:
        query = query.where(table.position > read_cursor(cursor, int))
    rows = conn.execute(query.order_by(table.position).limit(page_limit(limit) + 1)).mappings().all()
    return cut_page(_with_motions(conn, rows), limit, lambda row: str(row.position))


def items_of(conn: sa.Connection, items: Collection[UUID]) -> list[ItemRow]:
    """These items, those that are there, by job and in input order. Whose they are the caller knows."""
    table = schema.item.c
    query = _items().where(among(table.id, items)).order_by(table.job_id, table.position)
    return _with_motions(conn, conn.execute(query).mappings().all())


def list_motions(
    conn: sa.Connection,
    tenant: str,
    *,
    job: UUID | None = None,
    found: MotionFilter = EVERYTHING,
    cursor: str | None = None,
    limit: int = 50,
) -> Page[MotionRow]:
    """Motions that a filter finds: of a job in the order they were made; of the whole tenant newest first.

    Raises:
        NotFound: the tenant has no such job.
        InvalidInput: a filter that holds what no text can.
    """
    if job is not None:
        get_job(conn, tenant, job)
    while True:
        ids = find_motions(conn, tenant, found, job=job, cursor=cursor, limit=page_limit(limit) + 1)
        with fetching_by_id(conn):
            rows = {row.id: row for row in _motions(conn, among(schema.motion.c.id, ids))}
        # Between the two statements another transaction may have deleted some: that is not the end of the listing.
        kept = tuple(rows[each] for each in ids[:limit] if each in rows)
        if len(ids) <= limit:
            return Page(kept, None)
        if kept:
            return Page(kept, cursor_at(mark_of(kept[-1].created, kept[-1].id)))


def get_motion(conn: sa.Connection, tenant: str, motion: UUID) -> MotionRow:
    """One motion.

    Raises:
        NotFound: the tenant has no such motion.
    """
    return motions_of(conn, tenant, [motion])[0]


def motions_of(conn: sa.Connection, tenant: str, motions: Collection[UUID]) -> list[MotionRow]:
    """These motions, in the order given, each once.

    Raises:
        NotFound: the tenant lacks one of them.
    """
    asked = list(dict.fromkeys(motions))
    table = schema.motion.c
    rows = {row.id: row for row in _motions(conn, (table.tenant_id == tenant) & among(table.id, asked))}
    missing = [motion for motion in asked if motion not in rows]
    if missing:
        more = f" (and {len(missing) - 1} more of those given)" if len(missing) > 1 else ""
        raise NotFound(
            f"there is no such motion{more}", where=f"motion {missing[0]}", hint="`marey motions list` shows yours."
        )
    return [rows[motion] for motion in asked]


def events_after(conn: sa.Connection, tenant: str, job: UUID, seq: int = 0, limit: int = 500) -> list[EventRow]:
    """Events of a job with a greater `seq`, in order. Without gaps: `seq` is taken under the job's row lock.

    Raises:
        NotFound: the tenant has no such job.
    """
    get_job(conn, tenant, job)
    table = schema.job_event.c
    rows = conn.execute(
        sa.select(table.job_id, table.seq, table.kind, table.item_id, table.reason, table.data, table.at)
        .where(table.job_id == job, table.seq > seq)
        .order_by(table.seq)
        .limit(page_limit(limit))
    )
    return [EventRow(*row) for row in rows]


# --- rows ---


def _jobs() -> sa.Select[*tuple[Any, ...]]:
    table = schema.job.c
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
    )


def _job(row: sa.RowMapping) -> JobRow:
    values: dict[str, Any] = dict(row)
    values.update(control=JobControl(row["control"]), state=JobState(row["state"]))
    return JobRow(**values)


def _items() -> sa.Select[*tuple[Any, ...]]:
    table = schema.item.c
    return sa.select(
        *(table.id, table.job_id.label("job"), table.position, table.index, table.variant, table.name, table.prompt),
        *(table.model, table.bundle, table.seed, table.seconds, table.settings, table.tags, table.stage, table.state),
        *(table.attempts, table.solo, table.run_after, table.reason, table.problem, table.replaces),
        table.created_at.label("created"),
        table.finished_at.label("finished"),
    )


def _with_motions(conn: sa.Connection, rows: Sequence[sa.RowMapping]) -> list[ItemRow]:
    made = [row["id"] for row in rows if row["state"] == ItemState.SUCCEEDED]
    by_item = {motion.item: motion for motion in _motions(conn, among(schema.motion.c.item_id, made))}
    return [_item(row, by_item.get(row["id"])) for row in rows]


def _item(row: sa.RowMapping, motion: MotionRow | None) -> ItemRow:
    values: dict[str, Any] = dict(row)
    problem = row["problem"]
    values.update(
        stage=Stage(row["stage"]),
        state=ItemState(row["state"]),
        tags=tuple(row["tags"]),
        problem=None if problem is None else Problem(**problem),
        motion=motion,
    )
    return ItemRow(**values)


def _motions(
    conn: sa.Connection,
    wanted: sa.ColumnElement[bool],
) -> list[MotionRow]:
    """Motions with their files, in no order: two queries, however many."""
    motion, item = schema.motion.c, schema.item.c
    later = schema.item.alias("later")
    query = (
        sa.select(
            *(motion.id, motion.tenant_id.label("tenant"), motion.job_id.label("job"), motion.item_id.label("item")),
            *(item.name, item.prompt, item.model, item.bundle, motion.licence, item.seed, item.variant),
            *(motion.frames, motion.fps, motion.elapsed, motion.metadata.label("metadata")),
            motion.created_at.label("created"),
            *(item.index, item.tags, item.replaces, later.c.id.label("replaced_by")),
            *(motion.review, motion.reviewed_at.label("reviewed"), motion.reviewed_by, motion.review_comment),
        )
        .join(schema.item, item.id == motion.item_id)
        .outerjoin(later, later.c.replaces == motion.id)
        .where(wanted)
    )
    rows = conn.execute(query).mappings().all()
    file = schema.motion_file.c
    files = files_of(conn, file.motion_id, [row["id"] for row in rows], MotionFile, ~file.erasing)
    return [_motion(row, files[row["id"]]) for row in rows]


def _motion(row: sa.RowMapping, files: Sequence[MotionFile]) -> MotionRow:
    values: dict[str, Any] = dict(row)
    review = row["review"]
    values.update(tags=tuple(row["tags"]), review=None if review is None else Review(review))
    return MotionRow(**values, files=tuple(files))
