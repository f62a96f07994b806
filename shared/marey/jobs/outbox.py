"""The outbox: what webhooks are told is written in the transaction of what happened, or not at all.

Events hold ids, states and counters; never a name, a prompt or an error's text, which may quote one.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from uuid import UUID

import sqlalchemy as sa

from marey.jobs.ids import new_id
from marey.jobs.states import ENDED, EvaluationState, JobState, StreamState
from marey.jobs.webhook_types import EventKind

# A webhook that is just being deleted is waited for, and then not there: its deliveries could not refer to it.
WRITE = sa.text("""
    WITH wanted AS MATERIALIZED (
        SELECT id FROM webhook WHERE tenant_id = :tenant AND :kind = ANY(events) ORDER BY id FOR KEY SHARE
    ), event AS (
        INSERT INTO webhook_event (id, tenant_id, kind, data, at)
        SELECT :event, :tenant, :kind, CAST(:data AS jsonb), clock_timestamp() WHERE EXISTS (SELECT FROM wanted)
        RETURNING at
    )
    INSERT INTO webhook_delivery (webhook_id, event_id, next_at, created_at)
    SELECT wanted.id, :event, clock_timestamp(), event.at FROM wanted, event
""")


def tell(conn: sa.Connection, tenant: str, kind: EventKind, data: Mapping[str, object]) -> None:
    """Write an event for the webhooks of a tenant that want it; nothing, if none does."""
    values = {"tenant": tenant, "kind": str(kind), "event": new_id(), "data": json.dumps(data, default=str)}
    conn.execute(WRITE, values)


def tell_of_job(
    conn: sa.Connection, tenant: str, job: UUID, before: JobState, after: JobState, counters: Mapping[str, int]
) -> None:
    """Tell of a job that ended or was paused; of no other change."""
    if after is before:
        return
    data = {"job": job, "state": after, "counters": dict(counters)}
    if after in ENDED:
        tell(conn, tenant, EventKind.JOB_ENDED, data)
    elif after is JobState.PAUSED:
        tell(conn, tenant, EventKind.JOB_PAUSED, data)


def tell_of_stream(
    conn: sa.Connection, tenant: str, stream: UUID, state: StreamState, *, frames: int, job: UUID | None
) -> None:
    """Tell of a stream that is over; `job` makes its clip."""
    data = {"stream": stream, "state": state, "counters": {"frames": frames}, "job": job}
    tell(conn, tenant, EventKind.STREAM_ENDED, data)


def tell_of_evaluation(
    conn: sa.Connection,
    tenant: str,
    evaluation: UUID,
    state: EvaluationState,
    *,
    schedule: UUID | None,
    regressed: bool | None,
) -> None:
    """Tell of an evaluation that is over, and once more if it is worse than what it was compared with."""
    data = {"evaluation": evaluation, "state": state, "schedule": schedule, "regressed": regressed}
    tell(conn, tenant, EventKind.EVALUATION_ENDED, data)
    if regressed:
        tell(conn, tenant, EventKind.EVALUATION_REGRESSED, data)
