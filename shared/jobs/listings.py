"""Reading: jobs, items, motions, events. Cursors are opaque; a foreign one is an `InvalidInput`."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Sequence
from typing import Any
from uuid import UUID

import sqlalchemy as sa

from shared.errors import NotFound
from shared.jobs import schema
from shared.jobs.journal import among, no_such_job
from shared.jobs.pages import cut_page, page_limit, read_cursor
from shared.jobs.states import ItemState, JobControl, JobState, Stage
from shared.jobs.types import EventRow, ItemRow, JobRow, MotionFile, MotionRow, Page, Problem


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
    query = _jobs().where(table.tenant_id == tenant)
    if states:
        query = query.where(table.state.in_([str(state) for state in states]))
    if cursor is not None:
        query = query.where(table.id < read_cursor(cursor, UUID))
    rows = conn.execute(query.order_by(table.id.desc()).limit(page_limit(limit) + 1)).mappings().all()
    return cut_page([_job(row) for row in rows], limit, lambda row: str(row.id))


def list_items(
    conn: sa.Connection,
    tenant: str,
    job: UUID,
    *,
    states: Collection[ItemState] = (),
    cursor: str | None = None,
    limit: int = 100,
) -> Page[ItemRow]:
    """Items of a job with their motions, in input order, variants within prompt.

    Raises:
        NotFound: the tenant has no such job.
    """
    get_job(conn, tenant, job)
    table = schema.item.c
    query = sa.select(
        *(table.id, table.job_id.label("job"), table.position, table.index, table.variant, table.name, table.prompt),
        *(table.model, table.bundle, table.seed, table.seconds, table.settings, table.tags, table.stage, table.state),
        *(table.attempts, table.solo, table.run_after, table.reason, table.problem),
        table.created_at.label("created"),
        table.finished_at.label("finished"),
    ).where(table.job_id == job)
    if states:
        query = query.where(table.state.in_([str(state) for state in states]))
    if cursor is not None:
        query = query.where(table.position > read_cursor(cursor, int))
    rows = conn.execute(query.order_by(table.position).limit(page_limit(limit) + 1)).mappings().all()
    items = [row["id"] for row in rows if row["state"] == ItemState.SUCCEEDED]
    by_item = {motion.item: motion for motion in _motions(conn, among(schema.motion.c.item_id, items))}
    return cut_page([_item(row, by_item.get(row["id"])) for row in rows], limit, lambda row: str(row.position))


def list_motions(
    conn: sa.Connection, tenant: str, *, job: UUID | None = None, cursor: str | None = None, limit: int = 50
) -> Page[MotionRow]:
    """Motions: of a job in the order they were made; of the whole tenant newest first.

    Raises:
        NotFound: the tenant has no such job.
    """
    table = schema.motion.c
    wanted = table.tenant_id == tenant
    if job is not None:
        get_job(conn, tenant, job)
        wanted &= table.job_id == job
    if cursor is not None:
        after = read_cursor(cursor, UUID)
        wanted &= table.id > after if job is not None else table.id < after
    order = table.id if job is not None else table.id.desc()
    motions = _motions(conn, wanted, order=order, limit=page_limit(limit) + 1)
    return cut_page(motions, limit, lambda row: str(row.id))


def get_motion(conn: sa.Connection, tenant: str, motion: UUID) -> MotionRow:
    """One motion.

    Raises:
        NotFound: the tenant has no such motion.
    """
    table = schema.motion.c
    found = _motions(conn, (table.tenant_id == tenant) & (table.id == motion))
    if not found:
        raise NotFound("there is no such motion", where=f"motion {motion}")
    return found[0]


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
    )


def _job(row: sa.RowMapping) -> JobRow:
    values: dict[str, Any] = dict(row)
    values.update(control=JobControl(row["control"]), state=JobState(row["state"]))
    return JobRow(**values)


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
    *,
    order: sa.ColumnElement[object] | None = None,
    limit: int | None = None,
) -> list[MotionRow]:
    """Motions with their files: two queries, however many."""
    motion, item = schema.motion.c, schema.item.c
    query = (
        sa.select(
            *(motion.id, motion.tenant_id.label("tenant"), motion.job_id.label("job"), motion.item_id.label("item")),
            *(item.name, item.prompt, item.model, item.bundle, motion.licence, item.seed, item.variant),
            *(motion.frames, motion.fps, motion.elapsed, motion.metadata.label("metadata")),
            motion.created_at.label("created"),
        )
        .join(schema.item, item.id == motion.item_id)
        .where(wanted)
    )
    rows = conn.execute(query.order_by(motion.id if order is None else order).limit(limit)).mappings().all()
    files = _files(conn, [row["id"] for row in rows])
    return [MotionRow(**row, files=tuple(files[row["id"]])) for row in rows]


def _files(conn: sa.Connection, motions: Sequence[UUID]) -> dict[UUID, list[MotionFile]]:
    file, asset = schema.motion_file.c, schema.asset.c
    rows = conn.execute(
        sa.select(file.motion_id, file.format, asset.sha256, asset.size, asset.media_type)
        .join(schema.asset, asset.id == file.asset_id)
        .where(among(file.motion_id, motions))
        .order_by(file.format)
    )
    files: defaultdict[UUID, list[MotionFile]] = defaultdict(list)
    for motion, *values in rows:
        files[motion].append(MotionFile(*values))
    return files
