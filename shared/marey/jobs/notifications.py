"""Webhook events of jobs."""

from __future__ import annotations

from collections.abc import Mapping
from uuid import UUID

import sqlalchemy as sa

from marey.jobs.states import ENDED, JobState
from marey.webhooks.outbox import enqueue_event
from marey.webhooks.types import EventKind


def enqueue_job_event(
    conn: sa.Connection, tenant: str, job: UUID, before: JobState, after: JobState, counters: Mapping[str, int]
) -> None:
    """Enqueue a webhook event for a job that ended or was paused; other changes have none."""
    if after is before:
        return
    data = {"job": job, "state": after, "counters": dict(counters)}
    if after in ENDED:
        enqueue_event(conn, tenant, EventKind.JOB_ENDED, data)
    elif after is JobState.PAUSED:
        enqueue_event(conn, tenant, EventKind.JOB_PAUSED, data)
