"""Queue figures for monitoring: a few small queries, independent of the number of items."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime

import sqlalchemy as sa

# A lane is a counter row; the age of its oldest item is one probe of `ix_item_ready`, in input order: re-rolls come
# last. Items that wait for a retry (`run_after`) are in no lane.
QUEUES = sa.text("""
    WITH waiting AS (
        SELECT lane.queue, job.tenant_id, sum(lane.ready + lane.solo)::bigint AS items,
               min(oldest.created_at) AS since, min(lane.waiting_since) AS unserved
        FROM lane JOIN job ON job.id = lane.job_id
             LEFT JOIN LATERAL (
                 SELECT item.created_at FROM item
                 WHERE item.job_id = lane.job_id AND item.queue = lane.queue AND item.batch_key = lane.batch_key
                   AND item.state = 'ready' AND item.run_after IS NULL
                   AND item.solo = (lane.ready = 0)
                 ORDER BY item.position LIMIT 1
             ) AS oldest ON true
        WHERE lane.ready + lane.solo > 0 AND job.control = 'run'
        GROUP BY lane.queue, job.tenant_id
    ), running AS (
        SELECT lease.queue, job.tenant_id, count(*) AS items
        FROM lease JOIN job ON job.id = lease.job_id JOIN item ON item.lease_token = lease.token
        GROUP BY lease.queue, job.tenant_id
    )
    SELECT queue, tenant_id AS tenant, coalesce(waiting.items, 0)::bigint AS waiting,
           coalesce(running.items, 0)::bigint AS running,
           coalesce(extract(epoch FROM clock_timestamp() - waiting.since), 0)::float8 AS oldest,
           coalesce(extract(epoch FROM clock_timestamp() - waiting.unserved), 0)::float8 AS unserved
    FROM waiting FULL JOIN running USING (queue, tenant_id)
    ORDER BY queue, tenant
""")

STREAMS = sa.text("SELECT state, count(*) AS streams FROM stream WHERE ended_at IS NULL GROUP BY state")

WEBHOOKS = sa.text("""
    SELECT count(*) AS pending,
           coalesce(extract(epoch FROM clock_timestamp() - min(delivery.next_at)), 0)::float8 AS overdue
    FROM webhook_delivery AS delivery JOIN webhook ON webhook.id = delivery.webhook_id
    WHERE delivery.state = 'pending' AND NOT webhook.paused
""")


@dataclass(frozen=True)
class QueueDepth:
    """Load of one tenant in one queue; times in seconds."""

    queue: str
    tenant: str
    waiting: int
    """Ready items of running jobs."""
    running: int
    """Items under a lease."""
    oldest: float
    """Seconds since the oldest ready item was submitted; a retry does not restart the clock."""
    unserved: float
    """Maximum seconds since the last claim from a lane with ready items."""


@dataclass(frozen=True)
class Outbox:
    """Pending webhook deliveries, and how overdue the next one is, in seconds."""

    pending: int
    overdue: float


def queue_depths(conn: sa.Connection) -> list[QueueDepth]:
    """Return every queue and tenant with waiting or running items."""
    return [QueueDepth(**row) for row in conn.execute(QUEUES).mappings()]


def open_stream_counts(conn: sa.Connection) -> dict[str, int]:
    """Count open live streams by state."""
    return {row.state: row.streams for row in conn.execute(STREAMS)}


def outbox_state(conn: sa.Connection) -> Outbox:
    """Count pending deliveries of webhooks that are not paused."""
    row = conn.execute(WEBHOOKS).one()
    return Outbox(row.pending, max(0.0, row.overdue))


def overdue_leases(conn: sa.Connection, seconds: float) -> int:
    """Count leases that expired long ago and still exist: no sweeper runs."""
    query = sa.text("SELECT count(*) FROM lease WHERE expires_at < clock_timestamp() - make_interval(secs => :seconds)")
    return conn.execute(query, {"seconds": seconds}).scalar_one()


def server_version(conn: sa.Connection) -> str:
    """Return the version of Postgres, such as `18.4`."""
    return str(conn.execute(sa.text("SHOW server_version")).scalar_one()).split()[0]


def database_now(conn: sa.Connection) -> datetime:
    """Return the time of the database's clock."""
    return conn.execute(sa.text("SELECT clock_timestamp()")).scalar_one()
