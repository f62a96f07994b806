"""Time estimates from this platform's own measurements of the same bundles; no estimate without measurements."""

from __future__ import annotations

from collections.abc import Mapping
from uuid import UUID

import sqlalchemy as sa

from marey.jobs import tables
from marey.jobs.estimate_types import Estimate, QueuePlace, Speed
from marey.jobs.listings import get_job
from marey.jobs.states import ENDED, OPEN, JobControl
from marey.jobs.types import TEXT_QUEUE
from marey.jobs.workers import live_workers

MEASURED = 2000
"""Number of recent motions, of all tenants, that are measured."""

SPEEDS = sa.text("""
    WITH recent AS (SELECT item_id, elapsed, created_at FROM motion ORDER BY id DESC LIMIT :measured)
    SELECT item.bundle, count(*) AS motions, avg(recent.elapsed) AS seconds, min(recent.created_at) AS since,
           max(recent.created_at) AS until
    FROM recent JOIN item ON item.id = recent.item_id
    WHERE item.bundle = ANY(:bundles)
    GROUP BY item.bundle ORDER BY item.bundle
""")

# In claim order, with equal shares: within the tenant priority, then age; other tenants take turns with it.
AHEAD = sa.text("""
    WITH ours AS (SELECT id, tenant_id, priority, created_at FROM job WHERE id = :job),
    waiting AS (
        SELECT job.id, job.tenant_id, job.priority, job.created_at, sum(lane.ready + lane.solo) AS items
        FROM lane JOIN job ON job.id = lane.job_id
        WHERE lane.queue = ANY(:queues) AND lane.ready + lane.solo > 0 AND job.control = 'run' AND job.id <> :job
        GROUP BY job.id
    )
    SELECT count(*) FILTER (WHERE first) AS jobs, coalesce(sum(items) FILTER (WHERE first), 0) AS items,
           count(DISTINCT tenant_id) FILTER (WHERE NOT same) AS tenants
    FROM (
        SELECT waiting.tenant_id, waiting.items, waiting.tenant_id = ours.tenant_id AS same,
               waiting.tenant_id = ours.tenant_id
               AND (-waiting.priority, waiting.created_at, waiting.id) < (-ours.priority, ours.created_at, ours.id)
               AS first
        FROM waiting, ours
    ) AS ranked
""")


def estimate(conn: sa.Connection, items: Mapping[tuple[str, str], int], *, tenants: int = 1) -> Estimate:
    """Estimate the duration of motions with an empty queue.

    Args:
        items: motions by model and exact bundle.
        tenants: number of tenants that share the workers.
    """
    measured = {speed.bundle: speed for speed in _speeds(conn, [bundle for _, bundle in items])}
    workers = live_workers(conn)
    unmeasured = tuple(sorted(bundle for _, bundle in items if bundle not in measured))
    seconds = None
    if not unmeasured:
        # Queues have workers of their own, and run in parallel.
        by_queue = {
            queue: sum(count * measured[b].seconds for (q, b), count in items.items() if q == queue)
            / max(workers.get(queue, 0), 1)
            for queue, _ in items
        }
        seconds = max(by_queue.values(), default=0.0) * tenants
    return Estimate(
        items=sum(items.values()),
        seconds=seconds,
        workers={queue: workers.get(queue, 0) for queue in sorted({queue for queue, _ in items})},
        speeds=tuple(measured[bundle] for bundle in sorted(measured)),
        unmeasured=unmeasured,
    )


def place_of(conn: sa.Connection, tenant: str, job: UUID) -> QueuePlace:
    """Return the queue position of a job's waiting items, and when the job may be done.

    Raises:
        NotFound: the tenant has no such job.
    """
    row = get_job(conn, tenant, job)
    item = tables.item.c
    left = conn.execute(
        sa.select(item.model, item.bundle, sa.func.count().label("items"))
        .where(item.job_id == job, item.state.in_(sorted(OPEN)))
        .group_by(item.model, item.bundle)
    ).all()
    queues = [TEXT_QUEUE, *{each.model for each in left}]  # items in the text stage are generated later
    ahead = conn.execute(AHEAD, {"job": job, "queues": queues}).one()
    tenants = 1 + int(ahead.tenants)
    own = estimate(conn, {(each.model, each.bundle): each.items for each in left}, tenants=tenants)
    held = row.state in ENDED or row.control is not JobControl.RUN
    seconds = None
    if own.seconds is not None and not held:
        # Items ahead are assumed to take as long as its own motions.
        seconds = own.seconds * (1 + int(ahead.items) / max(own.items, 1))
    return QueuePlace(
        state=row.state,
        jobs_ahead=0 if held else int(ahead.jobs),
        items_ahead=0 if held else int(ahead.items),
        tenants=tenants,
        seconds=seconds,
        estimate=own,
    )


def _speeds(conn: sa.Connection, bundles: list[str]) -> list[Speed]:
    return [Speed(**row) for row in conn.execute(SPEEDS, {"bundles": bundles, "measured": MEASURED}).mappings()]
