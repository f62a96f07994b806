"""Reading: jobs, items, motions, events. Cursors are opaque; a foreign one is an `InvalidInput`."""

from __future__ import annotations

from collections.abc import Collection
from uuid import UUID

import sqlalchemy as sa

from shared.jobs.states import ItemState, JobState
from shared.jobs.types import EventRow, ItemRow, JobRow, MotionRow, Page


def get_job(conn: sa.Connection, tenant: str, job: UUID) -> JobRow:
    """One job.

    Raises:
        NotFound: the tenant has no such job.
    """
    raise NotImplementedError


def list_jobs(
    conn: sa.Connection, tenant: str, *, states: Collection[JobState] = (), cursor: str | None = None, limit: int = 50
) -> Page[JobRow]:
    """Jobs, newest first; of these states, if any are given."""
    raise NotImplementedError


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
    raise NotImplementedError


def list_motions(
    conn: sa.Connection, tenant: str, *, job: UUID | None = None, cursor: str | None = None, limit: int = 50
) -> Page[MotionRow]:
    """Motions: of a job in the order they were made; of the whole tenant newest first.

    Raises:
        NotFound: the tenant has no such job.
    """
    raise NotImplementedError


def get_motion(conn: sa.Connection, tenant: str, motion: UUID) -> MotionRow:
    """One motion.

    Raises:
        NotFound: the tenant has no such motion.
    """
    raise NotImplementedError


def events_after(conn: sa.Connection, tenant: str, job: UUID, seq: int = 0, limit: int = 500) -> list[EventRow]:
    """Events of a job with a greater `seq`, in order. Without gaps: `seq` is taken under the job's row lock.

    Raises:
        NotFound: the tenant has no such job.
    """
    raise NotImplementedError
