"""What an operator does to a job. Each verb names the tenant, writes an event with its reason, and answers the job."""

from __future__ import annotations

from uuid import UUID

import sqlalchemy as sa

from shared.jobs.types import JobRow


def pause(conn: sa.Connection, tenant: str, job: UUID, reason: str = "paused by operator") -> JobRow:
    """Claim no more of this job's items; leased ones finish. Paused already: no change.

    Raises:
        NotFound: the tenant has no such job.
        Conflict: the job has ended.
    """
    raise NotImplementedError


def resume(conn: sa.Connection, tenant: str, job: UUID, reason: str = "resumed by operator") -> JobRow:
    """Go on with a paused job. Running already: no change.

    Raises:
        NotFound: the tenant has no such job.
        Conflict: the job has ended.
    """
    raise NotImplementedError


def cancel(conn: sa.Connection, tenant: str, job: UUID, reason: str = "cancelled by operator") -> JobRow:
    """Cancel every open item and take leases away; workers learn it at their next heartbeat. Ended already: no change.

    Raises:
        NotFound: the tenant has no such job.
    """
    raise NotImplementedError


def retry(
    conn: sa.Connection, tenant: str, job: UUID, *, failed_only: bool = False, reason: str = "retried by operator"
) -> JobRow:
    """Send failed, dead and (unless `failed_only`) cancelled items back to ready, with no attempts used.

    Raises:
        NotFound: the tenant has no such job.
        Conflict: no item can be retried.
    """
    raise NotImplementedError


def set_priority(conn: sa.Connection, tenant: str, job: UUID, priority: int) -> JobRow:
    """Order of the job among its tenant's, −1000 … 1000, higher first.

    Raises:
        NotFound: the tenant has no such job.
        InvalidInput: out of range.
    """
    raise NotImplementedError


def set_comment(conn: sa.Connection, tenant: str, job: UUID, comment: str | None) -> JobRow:
    """Write or remove the comment.

    Raises:
        NotFound: the tenant has no such job.
    """
    raise NotImplementedError


def delete(conn: sa.Connection, tenant: str, job: UUID) -> None:
    """Remove a job that has ended, with its items, events and motions; their files go at the next garbage collection.

    Raises:
        NotFound: the tenant has no such job.
        Conflict: the job has open items; cancel it first.
    """
    raise NotImplementedError
