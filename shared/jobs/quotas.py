"""What a tenant uses of its quotas, and whether there is room for more.

No counter is kept for this, so none can drift: queued and running items are those of the counters on the tenant's open
jobs, which change in the transactions of the items themselves; bytes are summed over the rows of the files. Who needs
room takes the lock of the tenant's row, counts, and commits what it takes: two at once count one after the other.
Tenants without quotas pay nothing of that.
"""

from __future__ import annotations

import sqlalchemy as sa

from shared.errors import QuotaUsedUp
from shared.jobs import schema
from shared.jobs.tenant_types import Usage
from shared.jobs.tenants import get_tenant

EXPECTED_BYTES = 512 * 2**10
"""Of a motion's files where the tenant has none yet: five seconds as npz and BVH."""
MEASURED = 200  # newest motions that say what the next will take
QUEUE_SECONDS, BYTES_SECONDS = 30, 3600
"""When to ask again: the queue moves by itself, files go when somebody deletes them."""

OPEN_ITEMS = sa.text("""
    SELECT coalesce(sum(ready + leased), 0)::bigint AS queued, coalesce(sum(leased), 0)::bigint AS running
    FROM job WHERE tenant_id = :tenant AND finished_at IS NULL
""")

STORED = sa.text("SELECT coalesce(sum(size), 0)::bigint FROM asset WHERE tenant_id = :tenant AND state = 'stored'")

OF_A_MOTION = sa.text("""
    SELECT avg(bytes) FROM (
        SELECT sum(asset.size) AS bytes
        FROM (SELECT id FROM motion WHERE tenant_id = :tenant ORDER BY id DESC LIMIT :measured) AS newest
             JOIN motion_file ON motion_file.motion_id = newest.id JOIN asset ON asset.id = motion_file.asset_id
        GROUP BY newest.id
    ) AS motions
""")


def usage(conn: sa.Connection, tenant: str) -> Usage:
    """What a tenant has now."""
    queued, running = _open_items(conn, tenant)
    table = schema.stream.c
    streams = sa.select(sa.func.count()).where(table.tenant_id == tenant, table.ended_at.is_(None))
    return Usage(
        queued=queued,
        running=running,
        bytes=_stored(conn, tenant),
        expected=queued * bytes_of_a_motion(conn, tenant),
        streams=conn.execute(streams).scalar_one(),
    )


def check_room(conn: sa.Connection, tenant: str, items: int, *, lock: bool) -> None:
    """Nothing, if a tenant may have so many more items in the queue.

    Args:
        lock: until the transaction ends nobody else takes of the same room. Without it only the queue is looked at,
            which is cheap: bytes are summed once a submit.

    Raises:
        QuotaUsedUp: it may not.
        NotFound: there is no such tenant.
    """
    quotas = get_tenant(conn, tenant).quotas
    if quotas.queued is None and quotas.bytes is None:
        return
    if lock:
        _lock(conn, tenant)
        quotas = get_tenant(conn, tenant).quotas
    queued, _ = _open_items(conn, tenant)
    if quotas.queued is not None and queued + items > quotas.queued:
        raise _queue_full(tenant, items, queued, quotas.queued)
    if lock and quotas.bytes is not None:
        each, stored = bytes_of_a_motion(conn, tenant), _stored(conn, tenant)
        if stored + (queued + items) * each > quotas.bytes:
            raise _store_full(tenant, items * each, stored, queued * each, quotas.bytes)


def room_to_run(conn: sa.Connection, tenant: str, wanted: int) -> int:
    """How many of `wanted` items a tenant may run beside those it runs; its row stays locked."""
    _lock(conn, tenant)
    limit = get_tenant(conn, tenant).quotas.running
    if limit is None:
        return wanted
    _, running = _open_items(conn, tenant)
    return min(wanted, max(limit - running, 0))


def bytes_of_a_motion(conn: sa.Connection, tenant: str) -> int:
    """What the files of its next motion will likely take: the mean of the newest."""
    mean = conn.execute(OF_A_MOTION, {"tenant": tenant, "measured": MEASURED}).scalar_one()
    return EXPECTED_BYTES if mean is None else round(mean)


def _lock(conn: sa.Connection, tenant: str) -> None:
    """NO KEY: rows that refer to the tenant may be inserted by others meanwhile."""
    conn.execute(sa.select(schema.tenant.c.id).where(schema.tenant.c.id == tenant).with_for_update(key_share=True))


def _open_items(conn: sa.Connection, tenant: str) -> tuple[int, int]:
    """Queued, and of these running."""
    row = conn.execute(OPEN_ITEMS, {"tenant": tenant}).one()
    return row.queued, row.running


def _stored(conn: sa.Connection, tenant: str) -> int:
    return conn.execute(STORED, {"tenant": tenant}).scalar_one()


def _queue_full(tenant: str, asked: int, used: int, limit: int) -> QuotaUsedUp:
    fits = "Ask again when some are done." if asked <= limit else "Submit it as several jobs, one after the other."
    return QuotaUsedUp(
        f"{asked} items are more than the quota of queued items has room for: "
        f"{used} of {limit} are queued, {max(limit - used, 0)} are left",
        where=f"tenant {tenant}",
        hint=fits,
        seconds=QUEUE_SECONDS,
        quota="queued",
        limit=limit,
        used=used,
        asked=asked,
    )


def _store_full(tenant: str, asked: int, stored: int, expected: int, limit: int) -> QuotaUsedUp:
    used = stored + expected
    return QuotaUsedUp(
        f"some {asked} bytes are more than the quota of stored bytes has room for: {stored} of {limit} are stored, "
        f"{expected} expected of what is queued, {max(limit - used, 0)} are left",
        where=f"tenant {tenant}",
        hint="Delete jobs whose motions are fetched; the operator's next `marey admin gc` frees their bytes.",
        seconds=BYTES_SECONDS,
        quota="bytes",
        limit=limit,
        used=used,
        asked=asked,
    )
