"""Use of a tenant's quotas, and checks against them.

Nothing is counted separately, so no counter can drift: queued and running items are those of the counters on the
tenant's open jobs, which change in the transactions of the items themselves; bytes are summed over the rows of
the files. A transaction that needs quota locks the tenant's row, counts, and commits: concurrent ones count one
after the other. Tenants without quotas have no overhead.
"""

from __future__ import annotations

import sqlalchemy as sa

from marey.core.errors import QuotaUsedUp
from marey.tenants import tables
from marey.tenants.repository import get_tenant
from marey.tenants.types import QuotaHeadroom, Usage

EXPECTED_BYTES = 512 * 2**10
"""Estimated file size of a motion for a tenant without any: five seconds as npz and BVH."""
MEASURED = 200  # newest motions used to estimate the size of the next
QUEUE_SECONDS, BYTES_SECONDS = 30, 3600
"""Retry delays: the queue moves by itself, bytes are freed by deletions."""

OPEN_ITEMS = sa.text("""
    SELECT coalesce(sum(ready + leased), 0)::bigint AS queued, coalesce(sum(leased), 0)::bigint AS running
    FROM job WHERE tenant_id = :tenant AND finished_at IS NULL
""")

OPEN_STREAMS = sa.text("SELECT count(*) FROM stream WHERE tenant_id = :tenant AND ended_at IS NULL")

STORED = sa.text("""
    SELECT coalesce(sum(size), 0)::bigint - (
        SELECT coalesce(sum(size), 0)::bigint FROM asset
        WHERE state = 'stored'
          AND id IN (SELECT asset_id FROM made_file WHERE tenant_id = :tenant AND asset_id IS NOT NULL)
          AND NOT EXISTS (SELECT FROM motion_file WHERE motion_file.asset_id = asset.id)
          AND NOT EXISTS (SELECT FROM evaluation_report WHERE evaluation_report.asset_id = asset.id)
          AND NOT EXISTS (SELECT FROM rig WHERE rig.asset_id = asset.id)
    )
    FROM asset WHERE tenant_id = :tenant AND state = 'stored'
""")
"""Without files that were made on request, which have a quota of their own."""

OF_A_MOTION = sa.text("""
    SELECT avg(bytes) FROM (
        SELECT sum(asset.size) AS bytes
        FROM (SELECT id FROM motion WHERE tenant_id = :tenant ORDER BY id DESC LIMIT :measured) AS newest
             JOIN motion_file ON motion_file.motion_id = newest.id JOIN asset ON asset.id = motion_file.asset_id
        GROUP BY newest.id
    ) AS motions
""")


def usage(conn: sa.Connection, tenant: str) -> Usage:
    """Return the current use of a tenant."""
    queued, running = _open_items(conn, tenant)
    return Usage(
        queued=queued,
        running=running,
        bytes=_stored(conn, tenant),
        expected=queued * bytes_of_a_motion(conn, tenant),
        streams=conn.execute(OPEN_STREAMS, {"tenant": tenant}).scalar_one(),
    )


def check_queue(conn: sa.Connection, tenant: str, items: int) -> None:
    """Validate that a tenant's queue has capacity for more items. Bytes, which need a sum over the files, are not
    checked, and concurrent requests may take the same capacity.

    Raises:
        QuotaUsedUp: the queue is full.
        NotFound: there is no such tenant.
    """
    quotas = get_tenant(conn, tenant).quotas
    if quotas.queued is not None:
        _refuse_beyond(tenant, _in_queue(quotas.queued, _open_items(conn, tenant)[0], items))


def check_quotas(conn: sa.Connection, tenant: str, items: int) -> tuple[QuotaHeadroom, ...]:
    """Return the demand of more items on each quota of a tenant; concurrent requests may take the same capacity.

    Raises:
        QuotaUsedUp: a quota is exhausted.
        NotFound: there is no such tenant.
    """
    quotas = get_tenant(conn, tenant).quotas
    if quotas.queued is None and quotas.bytes is None:
        return ()
    queued, _ = _open_items(conn, tenant)
    headrooms: list[QuotaHeadroom] = []
    if quotas.queued is not None:
        headrooms.append(_in_queue(quotas.queued, queued, items))
        _refuse_beyond(tenant, headrooms[-1])
    if quotas.bytes is not None:
        each = bytes_of_a_motion(conn, tenant)
        headrooms.append(QuotaHeadroom("bytes", quotas.bytes, _stored(conn, tenant), queued * each, items * each))
        _refuse_beyond(tenant, headrooms[-1])
    return tuple(headrooms)


def reserve_quotas(conn: sa.Connection, tenant: str, items: int) -> None:
    """Run `check_quotas`, and reserve the capacity until the transaction ends.

    Raises:
        QuotaUsedUp, NotFound: as `check_quotas`.
    """
    quotas = get_tenant(conn, tenant).quotas
    if quotas.queued is None and quotas.bytes is None:
        return
    _lock(conn, tenant)
    check_quotas(conn, tenant, items)


def reserve_bytes(conn: sa.Connection, tenant: str, size: int) -> None:
    """Validate that a tenant may store `size` bytes more, and reserve them until the transaction ends.

    Raises:
        QuotaUsedUp: the quota of bytes is exhausted.
        NotFound: there is no such tenant.
    """
    limit = get_tenant(conn, tenant).quotas.bytes
    if limit is None:
        return
    _lock(conn, tenant)
    expected = _open_items(conn, tenant)[0] * bytes_of_a_motion(conn, tenant)
    _refuse_beyond(tenant, QuotaHeadroom("bytes", limit, _stored(conn, tenant), expected, size))


def runnable_items(conn: sa.Connection, tenant: str, wanted: int) -> int:
    """Return how many of `wanted` items a tenant may run beside its running ones; its row stays locked."""
    _lock(conn, tenant)
    limit = get_tenant(conn, tenant).quotas.running
    if limit is None:
        return wanted
    _, running = _open_items(conn, tenant)
    return min(wanted, max(limit - running, 0))


def bytes_of_a_motion(conn: sa.Connection, tenant: str) -> int:
    """Estimate the size of the files of a tenant's next motion: the mean of the newest."""
    mean = conn.execute(OF_A_MOTION, {"tenant": tenant, "measured": MEASURED}).scalar_one()
    return EXPECTED_BYTES if mean is None else round(mean)


def _lock(conn: sa.Connection, tenant: str) -> None:
    """Lock the tenant's row. NO KEY: rows that refer to the tenant may be inserted meanwhile."""
    conn.execute(sa.select(tables.tenant.c.id).where(tables.tenant.c.id == tenant).with_for_update(key_share=True))


def _open_items(conn: sa.Connection, tenant: str) -> tuple[int, int]:
    """Count queued items, and running ones among them."""
    row = conn.execute(OPEN_ITEMS, {"tenant": tenant}).one()
    return row.queued, row.running


def _stored(conn: sa.Connection, tenant: str) -> int:
    return conn.execute(STORED, {"tenant": tenant}).scalar_one()


def _in_queue(limit: int, queued: int, asked: int) -> QuotaHeadroom:
    return QuotaHeadroom("queued", limit, queued, 0, asked)


def _refuse_beyond(tenant: str, headroom: QuotaHeadroom) -> None:
    if headroom.asked <= headroom.limit - headroom.used:
        return
    message, hint, seconds = (_queue_full if headroom.quota == "queued" else _store_full)(headroom)
    raise QuotaUsedUp(
        message,
        where=f"tenant {tenant}",
        hint=hint,
        seconds=seconds,
        quota=headroom.quota,
        limit=headroom.limit,
        used=headroom.used,
        asked=headroom.asked,
    )


def _queue_full(headroom: QuotaHeadroom) -> tuple[str, str, int]:
    """Return message, hint and retry delay."""
    return (
        f"{headroom.asked} items exceed the quota of queued items: "
        f"{headroom.used} of {headroom.limit} are queued, {headroom.left} are left",
        "Try again when some are done."
        if headroom.asked <= headroom.limit
        else "Submit it as several jobs, one after the other.",
        QUEUE_SECONDS,
    )


def _store_full(headroom: QuotaHeadroom) -> tuple[str, str, int]:
    return (
        f"about {headroom.asked} bytes exceed the quota of stored bytes: "
        f"{headroom.stands} of {headroom.limit} are stored, "
        f"{headroom.expected} expected of what is queued, {headroom.left} are left",
        "Delete jobs whose motions are fetched; the operator's next `marey admin gc` frees their bytes.",
        BYTES_SECONDS,
    )
