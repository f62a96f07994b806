"""Items without a motion, for callers that ask for the motion."""

from __future__ import annotations

from uuid import UUID

import sqlalchemy as sa

from marey.core.errors import NotFound
from marey.jobs import tables
from marey.jobs.states import ItemState, JobControl

OPEN = {ItemState.READY: "waits for a worker", ItemState.LEASED: "is being made"}


def item_is(item: UUID) -> sa.ColumnElement[bool]:
    """Return the condition of one item."""
    return tables.item.c.id == item


def item_at(job: UUID, index: int, variant: int | None = None) -> sa.ColumnElement[bool]:
    """Return the condition of the items of one prompt of a job, or of one variant."""
    column = tables.item.c
    # Positions count all items, so an item's is never below its index: the index on positions narrows the search.
    at = (column.job_id == job) & (column.index == index) & (column.position >= index)
    return at if variant is None else at & (column.variant == variant)


def no_motion(conn: sa.Connection, tenant: str, wanted: sa.ColumnElement[bool], *, where: str) -> NotFound | None:
    """Return the error that tells why an item of the tenant has no motion, or which one it has.

    Args:
        wanted: condition of items; the first in input order counts.
        where: the reference to a motion, for the error.

    Returns:
        None if the tenant has no such item, or the motion was deleted.
    """
    item, job, motion = tables.item.c, tables.job.c, tables.motion.c
    row = conn.execute(
        sa.select(item.id, item.job_id, item.state, item.problem, job.control, motion.id.label("motion"))
        .join(tables.job, job.id == item.job_id)
        .outerjoin(tables.motion, motion.item_id == item.id)
        .where(wanted, job.tenant_id == tenant)
        .order_by(item.position)
        .limit(1)
    ).one_or_none()
    if row is None:
        return None
    if row.motion is not None:
        return NotFound("this is an item, not a motion", where=where, hint=f"Its motion is {row.motion}.")
    if row.state in OPEN:
        if row.control == JobControl.PAUSED:
            hint = f"Its job is paused: `marey jobs resume {row.job_id}` goes on."
        else:
            hint = f"`marey jobs wait {row.job_id}` waits for its job."
        return NotFound(f"the motion is not made yet: its item {OPEN[row.state]}", where=where, hint=hint)
    if row.state == ItemState.CANCELLED:
        hint = f"`marey jobs retry {row.job_id}` makes it after all."
        return NotFound("there is no motion: its item was cancelled", where=where, hint=hint)
    if row.state in (ItemState.FAILED, ItemState.DEAD):
        problem = row.problem or {"message": "it is not known why", "hint": None}
        hint = problem.get("hint") or f"`marey jobs show {row.job_id}` says more."
        return NotFound(f"there is no motion: its item failed: {problem['message']}", where=where, hint=hint)
    return None
