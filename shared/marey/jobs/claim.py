"""Claims of batches, and renewal of their leases."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any
from uuid import UUID, uuid4

import sqlalchemy as sa

from marey.db.sql import CLOCK, interval
from marey.items.item import SPEC_FIELDS
from marey.jobs import tables
from marey.jobs.journal import LockedJob, lock_job, record
from marey.jobs.lease_types import Claim, ClaimedItem, HeartbeatReply
from marey.jobs.policy import Policy, policy
from marey.jobs.states import ItemStage, ItemState, JobControl
from marey.jobs.types import Edits
from marey.tenants.quotas import runnable_items

LANES_TRIED = 8  # lanes tried in a claim; a worker that finds all of them emptied by others claims again

# Running items by tenant, and the jobs of tenants with capacity.
SHARE = """
    share AS (
        SELECT tenant_id, sum(leased) AS running FROM job WHERE id IN (SELECT job_id FROM lease) GROUP BY tenant_id
    ), allowed AS (
        SELECT tenant.id, coalesce(share.running, 0) AS running, tenant.max_running
        FROM tenant LEFT JOIN share ON share.tenant_id = tenant.id
        WHERE tenant.suspended_at IS NULL
          AND (tenant.max_running IS NULL OR coalesce(share.running, 0) < tenant.max_running)
    )
"""

# In order: tenant with the smallest share running, priority, age. The first lanes, and the first with the worker's
# loaded batch key.
LANES = sa.text(f"""
    WITH {SHARE}, ordered AS (
        SELECT lane.job_id, lane.batch_key,
               extract(epoch FROM clock_timestamp() - lane.waiting_since)::float8 AS waited,
               allowed.running, allowed.max_running IS NOT NULL AS limited, lane.solo > 0 AS lonely,
               row_number() OVER (
                   ORDER BY allowed.running, job.priority DESC, job.created_at, job.id, lane.waiting_since,
                            lane.batch_key
               ) AS place
        FROM lane JOIN job ON job.id = lane.job_id JOIN allowed ON allowed.id = job.tenant_id
        WHERE lane.queue = :queue AND lane.ready + lane.solo > 0 AND job.control = 'run'
    )
    SELECT job_id, batch_key, waited, running, limited, lonely, place FROM ordered WHERE place <= :tried
    UNION
    (SELECT job_id, batch_key, waited, running, limited, lonely, place FROM ordered WHERE batch_key = :prefer
     ORDER BY place LIMIT 1)
    ORDER BY place
""")  # noqa: S608 - of constants alone

# One statement, since each costs a round trip while the job is locked. Without a free item it writes nothing.
TAKE = sa.text(f"""
    WITH picked AS MATERIALIZED (
        SELECT id FROM item
        WHERE job_id = :job AND queue = :queue AND batch_key = :batch_key
          AND state = 'ready' AND run_after IS NULL AND solo = :solo
        ORDER BY position
        LIMIT :limit
        FOR UPDATE SKIP LOCKED
    ), held AS (
        INSERT INTO lease (token, job_id, queue, worker, solo, claimed_at, progress_at, expires_at)
        SELECT :token, :job, :queue, :worker, :solo, now, now, now + make_interval(secs => :seconds)
        FROM clock_timestamp() AS now
        WHERE EXISTS (SELECT FROM picked)
    ), emptied AS (
        UPDATE lane SET ready = ready - CASE WHEN :solo THEN 0 ELSE taken.items END,
                        solo = solo - CASE WHEN :solo THEN taken.items ELSE 0 END,
                        waiting_since = clock_timestamp()
        FROM (SELECT count(*) AS items FROM picked) AS taken
        WHERE job_id = :job AND queue = :queue AND batch_key = :batch_key AND taken.items > 0
    )
    UPDATE item SET state = 'leased', lease_token = :token FROM picked WHERE item.id = picked.id
    RETURNING item.id, item.position, item.index, item.variant, item.model, item.bundle, item.text_key, item.seed,
              item.settings, item.attempts, item.stage, item.scope, item.edits,
              {", ".join(f"item.{name}" for name in SPEC_FIELDS)}
""")  # noqa: S608

ALONE = sa.text("SELECT EXISTS (SELECT FROM lease WHERE job_id = :job AND queue = :queue AND solo)")

TEXTS = sa.text("SELECT key, blob FROM text_features WHERE key = ANY(:keys)")

WAITING = sa.text(f"""
    WITH {SHARE}
    SELECT lane.queue, sum(ceil(lane.ready::numeric / size.items) + lane.solo)::int AS batches
    FROM lane JOIN job ON job.id = lane.job_id JOIN allowed ON allowed.id = job.tenant_id
         JOIN unnest(CAST(:queues AS text[]), CAST(:sizes AS int[])) AS size(queue, items) ON size.queue = lane.queue
    WHERE lane.ready + lane.solo > 0 AND job.control = 'run'
    GROUP BY lane.queue
""")  # noqa: S608


@dataclass(frozen=True)
class _Lane:
    job: UUID
    batch_key: str
    waited: float
    running: int
    """Running items of its tenant."""
    limited: bool
    """True if its tenant has a quota of running items."""
    lonely: bool
    """True if it has items that must run alone."""


def claim(
    conn: sa.Connection,
    queue: str,
    worker: str,
    limit: int,
    *,
    prefer_batch_key: str | None = None,
    rules: Policy | None = None,
) -> Claim | None:
    """Claim up to `limit` ready items of one lane under a new lease; None when there is no work.

    The lane is that of the tenant with the smallest share running, then of the highest priority, then of the oldest
    job. With `prefer_batch_key` (the bundle and settings a worker has loaded) such a lane goes first until the next
    in order has waited 30 s, or 5 s if its tenant has less running. Nothing is claimed from suspended tenants, or
    beyond a tenant's quota of running items.
    """
    rules = rules or policy()
    found = conn.execute(LANES, {"queue": queue, "tried": LANES_TRIED, "prefer": prefer_batch_key})
    lanes = [_Lane(row.job_id, row.batch_key, row.waited, row.running, row.limited, row.lonely) for row in found]
    contended: list[_Lane] = []
    for lane in _preferred_first(lanes, prefer_batch_key, rules):
        taken, locked = _try_lane(conn, lane, queue, worker, limit, rules, skip_locked=True)
        if taken is not None:
            return taken
        if not locked:
            contended.append(lane)
    for lane in contended:  # only lanes that other workers are changing right now: wait for them
        taken, _ = _try_lane(conn, lane, queue, worker, limit, rules, skip_locked=False)
        if taken is not None:
            return taken
    return None


def heartbeat(
    conn: sa.Connection,
    lease_token: UUID,
    open_items: Collection[UUID],
    *,
    progressed: bool,
    rules: Policy | None = None,
) -> HeartbeatReply:
    """Renew a lease and return the items that were cancelled or lost.

    Args:
        open_items: items of the claim that are not committed, failed or released yet.
        progressed: the decode loop moved since the last heartbeat, or a bundle is being loaded or compiled. Without
            progress for 120 s the lease is not renewed.
    """
    rules = rules or policy()
    table = tables.lease.c
    if progressed:
        renewal = {"expires_at": CLOCK + interval(rules.lease), "progress_at": CLOCK}
    else:
        moves = table.progress_at > CLOCK - interval(rules.stall)
        renewal = {"expires_at": sa.case((moves, CLOCK + interval(rules.lease)), else_=table.expires_at)}
    renewed = conn.execute(sa.update(tables.lease).where(table.token == lease_token).values(renewal))
    if renewed.rowcount == 0:
        return HeartbeatReply(lost=True, gone=frozenset(open_items))
    return HeartbeatReply(lost=False, gone=frozenset(open_items) - leased_items(conn, lease_token))


def leased_items(conn: sa.Connection, lease_token: UUID) -> frozenset[UUID]:
    """Return the items under a lease; none once it is gone."""
    table = tables.item.c
    return frozenset(conn.execute(sa.select(table.id).where(table.lease_token == lease_token)).scalars())


def load_texts(conn: sa.Connection, keys: Sequence[str]) -> dict[str, bytes]:
    """Return the known feature blobs of these keys, in one query."""
    return {row.key: row.blob for row in conn.execute(TEXTS, {"keys": list(set(keys))})}


def waiting_batches(conn: sa.Connection, batch_sizes: Mapping[str, int]) -> dict[str, int]:
    """Count waiting batches by queue, where a batch of queue q holds `batch_sizes[q]` items. Empty queues are left
    out."""
    sizes = {"queues": list(batch_sizes), "sizes": list(batch_sizes.values())}
    return {row.queue: row.batches for row in conn.execute(WAITING, sizes)}


def waiting_items(conn: sa.Connection) -> dict[str, int]:
    """Count ready items of running jobs by queue. Empty queues are left out."""
    lane, job = tables.lane, tables.job
    count = sa.func.sum(lane.c.ready + lane.c.solo)
    query = (
        sa.select(lane.c.queue, count.label("items"))
        .join(job, job.c.id == lane.c.job_id)
        .where(job.c.control == JobControl.RUN)
        .group_by(lane.c.queue)
        .having(count > 0)
    )
    return {row.queue: int(row.items) for row in conn.execute(query)}


def _preferred_first(lanes: Sequence[_Lane], prefer: str | None, rules: Policy) -> list[_Lane]:
    """Order the lanes to try: one that fits the loaded bundle first, unless the next in order has waited too long."""
    ordered = list(lanes)
    fitting = next((lane for lane in ordered if lane.batch_key == prefer), None)
    if fitting is not None:
        patience = rules.patience if fitting.running <= ordered[0].running else rules.tenant_patience
        if ordered[0].waited < patience:
            ordered.remove(fitting)
            ordered.insert(0, fitting)
    return ordered


def _try_lane(
    conn: sa.Connection, lane: _Lane, queue: str, worker: str, limit: int, rules: Policy, *, skip_locked: bool
) -> tuple[Claim | None, bool]:
    """Return the items taken from a lane, and whether its job could be locked.

    If nothing was taken, the job is unlocked again: two workers that each held one job and waited for the other's
    would deadlock.
    """
    savepoint = conn.begin_nested()
    job = lock_job(conn, lane.job, skip_locked=skip_locked)
    if job is not None and lane.limited:
        limit = runnable_items(conn, job.tenant, limit)
    taken = None if job is None or limit == 0 else _take(conn, job, queue, lane, worker, limit, rules)
    if taken is None:
        savepoint.rollback()
    else:
        savepoint.commit()
    return taken, job is not None


def _take(
    conn: sa.Connection, job: LockedJob, queue: str, lane: _Lane, worker: str, limit: int, rules: Policy
) -> Claim | None:
    """Take items of a lane. Items whose lease expired in a batch are retried one at a time, beside fresh items: items
    of a killed worker restart at once however long the queue is, and an item that crashes its worker occupies only one
    worker."""
    if job.control is not JobControl.RUN:
        return None
    token = uuid4()
    batch_key = lane.batch_key
    where = {"job": job.id, "queue": queue, "batch_key": batch_key}
    lease = {"token": token, "worker": worker, "seconds": rules.lease}
    alone_first = lane.lonely and not conn.execute(ALONE, {"job": job.id, "queue": queue}).scalar_one()
    rows: Sequence[sa.RowMapping] = ()
    solo = False
    for solo in (alone_first, not alone_first):
        rows = conn.execute(TAKE, {**where, **lease, "solo": solo, "limit": 1 if solo else limit}).mappings().all()
        if rows:
            break
    if not rows:
        return None
    record(conn, job, moved={(ItemState.READY, ItemState.LEASED): len(rows)})
    items = sorted((_claimed(row) for row in rows), key=lambda item: item.position)
    stage = ItemStage(rows[0]["stage"])
    bundle = items[0].bundle
    return Claim(
        token, job.tenant, job.id, queue, stage, batch_key, bundle, solo, tuple(items), job.traceparent, job.scope
    )


def _claimed(row: sa.RowMapping) -> ClaimedItem:
    values: dict[str, Any] = dict(row)
    del values["stage"]
    values.update(tags=tuple(row["tags"]), edits=Edits.of(row["edits"]))
    return ClaimedItem(**values)
