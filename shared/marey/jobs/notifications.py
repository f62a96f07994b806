"""Webhook events of jobs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from uuid import UUID

import sqlalchemy as sa

from marey.jobs.quality_counts import count_quality
from marey.jobs.states import ENDED, JobState
from marey.webhooks.outbox import enqueue_event, is_subscribed
from marey.webhooks.types import EventKind


def enqueue_job_event(
    conn: sa.Connection, tenant: str, job: UUID, before: JobState, after: JobState, counters: Mapping[str, int]
) -> None:
    """Enqueue a webhook event for a job that ended or was paused; other changes have none.

    An end tells the quality of the job's motions too, which is counted only for a subscriber.
    """
    if after is before:
        return
    data: dict[str, object] = {"job": job, "state": after, "counters": dict(counters)}
    if after in ENDED:
        if is_subscribed(conn, tenant, EventKind.JOB_ENDED):
            enqueue_event(conn, tenant, EventKind.JOB_ENDED, data | {"quality": asdict(count_quality(conn, job))})
    elif after is JobState.PAUSED:
        enqueue_event(conn, tenant, EventKind.JOB_PAUSED, data)
