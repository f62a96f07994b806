"""Submit: job, items, lanes, event and idempotency row in one transaction."""

from __future__ import annotations

import sqlalchemy as sa

from shared.jobs.types import NewJob, SubmittedJob


def submit(conn: sa.Connection, job: NewJob) -> SubmittedJob:
    """Write a job and its items; nothing is published, the relay is notified when the transaction commits.

    Items whose text features are in the database already skip the text stage. With an idempotency key, a second submit
    of the same body within 24 hours answers the first one's job, `replayed`.

    Raises:
        InvalidInput: no items, or a value out of its range.
        IdempotencyMismatch: the key was used with another body.
    """
    raise NotImplementedError
