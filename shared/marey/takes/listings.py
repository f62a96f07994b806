"""Listings of motions, newest first or in creation order."""

from __future__ import annotations

from uuid import UUID

import sqlalchemy as sa

from marey.db.pages import PAGE, Page, cursor_at, mark_of, page_limit
from marey.db.sql import among
from marey.jobs import tables
from marey.jobs.listings import get_job
from marey.jobs.motions import read_motions
from marey.jobs.types import MotionRow
from marey.takes.searching import fetching_by_id, find_motions
from marey.takes.types import MotionFilter

EVERYTHING = MotionFilter()


def list_motions(
    conn: sa.Connection,
    tenant: str,
    *,
    job: UUID | None = None,
    found: MotionFilter = EVERYTHING,
    cursor: str | None = None,
    limit: int = PAGE,
) -> Page[MotionRow]:
    """Return motions that match a filter: of a job in creation order; of the whole tenant newest first.

    Raises:
        NotFound: the tenant has no such job.
        InvalidInput: a filter with forbidden characters.
    """
    if job is not None:
        get_job(conn, tenant, job)
    while True:
        ids = find_motions(conn, tenant, found, job=job, cursor=cursor, limit=page_limit(limit) + 1)
        with fetching_by_id(conn):
            rows = {row.id: row for row in read_motions(conn, among(tables.motion.c.id, ids))}
        # Another transaction may have deleted some in between: that is not the end of the listing.
        kept = tuple(rows[each] for each in ids[:limit] if each in rows)
        if len(ids) <= limit:
            return Page(kept, None)
        if kept:
            return Page(kept, cursor_at(mark_of(kept[-1].created, kept[-1].id)))
