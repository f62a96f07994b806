"""Files made of a motion on request, kept per tenant up to a quota: claims of the processes that make them, results,
eviction. They are a cache: each can be made again, byte for byte."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Protocol
from uuid import UUID, uuid4

import sqlalchemy as sa

from marey.core.errors import Unreachable
from marey.db.database import transaction
from marey.db.deadlines import HEARTBEAT, MAINTENANCE
from marey.db.sql import CLOCK, among, interval
from marey.exporters.registry import CANONICAL
from marey.jobs import tables
from marey.jobs.lease_rows import document
from marey.jobs.types import FailureReason, MotionFile
from marey.takes.assets import ContentStore, keep_content, write_content
from marey.takes.gc import ObjectStore, remove_assets
from marey.takes.types import RigRow

CLAIM_SECONDS = 15.0
"""Seconds until another process may take over a file whose maker is silent."""
FAILURE_SECONDS = 600.0
"""Seconds for which a file that cannot be made is not tried again."""
EXPIRED_KEPT = 3600.0
MADE_LOCK = 0x6D616465
"""First key of the advisory locks under which a tenant's oldest files are removed."""
ATTEMPTS = 3
"""Times that content is written which garbage collection removes before it is referred to."""

# Locks the motion and the rig first, as their deletions do.
CLAIM = sa.text("""
    WITH rig_there AS (
        SELECT id FROM rig WHERE id = :rig AND tenant_id = :tenant AND version = :rig_version FOR SHARE
    ), wanted AS (
        SELECT id, tenant_id FROM motion
        WHERE id = :motion AND tenant_id = :tenant AND EXISTS (
            SELECT FROM motion_file JOIN asset ON asset.id = motion_file.asset_id
            WHERE motion_file.motion_id = motion.id AND motion_file.format = :canonical AND asset.sha256 = :source
              AND NOT motion_file.erasing
        ) AND (CAST(:rig AS uuid) IS NULL OR EXISTS (SELECT FROM rig_there))
        FOR KEY SHARE
    )
    INSERT INTO made_file (motion_id, key, tenant_id, format, rig_id, claim, expires_at)
    SELECT id, :key, tenant_id, :format, CAST(:rig AS uuid), :claim,
           clock_timestamp() + make_interval(secs => :seconds) FROM wanted
    ON CONFLICT (motion_id, key) DO UPDATE SET claim = excluded.claim, problem = NULL, expires_at = excluded.expires_at
        WHERE made_file.expires_at < clock_timestamp()
    RETURNING claim
""")

# Deletion and erasure of the motion wait for the end of the transaction, and then find the new file.
HOLD_SOURCE = sa.text("""
    SELECT asset.sha256 FROM motion
    JOIN motion_file ON motion_file.motion_id = motion.id JOIN asset ON asset.id = motion_file.asset_id
    WHERE motion.id = :motion AND motion_file.format = :format AND asset.sha256 = :sha256 AND NOT motion_file.erasing
    FOR KEY SHARE OF motion FOR SHARE OF motion_file
""")

# Rows that another transaction is removing are left to it: waiting for them could end in a deadlock.
EVICT = sa.text("""
    WITH sums AS (
        SELECT motion_id, key, sum(size) OVER (ORDER BY made_at DESC, motion_id, key) AS total
        FROM made_file WHERE tenant_id = :tenant AND asset_id IS NOT NULL
    ), late AS (
        SELECT made_file.motion_id, made_file.key FROM made_file JOIN sums USING (motion_id, key)
        WHERE total > :quota AND NOT (motion_id = :motion AND key = :key)
        FOR UPDATE OF made_file SKIP LOCKED
    )
    DELETE FROM made_file USING late WHERE made_file.motion_id = late.motion_id AND made_file.key = late.key
    RETURNING made_file.asset_id
""")


class WritableStore(ObjectStore, ContentStore, Protocol):
    """Methods of an asset store that keeping files needs (`marey.storage.AssetStore` fits)."""


@dataclass(frozen=True)
class MadeFile:
    """A file made on request: it is there, or cannot be made, or a process makes it (neither is set)."""

    file: MotionFile | None = None
    problem: FailureReason | None = None


@dataclass(frozen=True)
class MakingClaim:
    """The right to make a file, until it expires.

    Attributes:
        source: sha256 of the npz.
        key: `marey.exporters.making.FileRecipe.key`.
    """

    tenant: str
    motion: UUID
    source: str
    key: str
    format: str
    token: UUID


def find_made(conn: sa.Connection, motion: UUID, key: str) -> MadeFile | None:
    """Return a made file; None if it is to be made: no process is at it, and no failure is recent."""
    made, asset = tables.made_file.c, tables.asset.c
    query = (
        sa.select(made.asset_id, made.format, asset.sha256, asset.size, asset.media_type, made.problem)
        .select_from(sa.outerjoin(tables.made_file, tables.asset, asset.id == made.asset_id))
        .where(made.motion_id == motion, made.key == key, made.expires_at.is_(None) | (made.expires_at >= CLOCK))
    )
    row = conn.execute(query).one_or_none()
    if row is None:
        return None
    if row.asset_id is not None:
        return MadeFile(MotionFile(row.format, row.sha256, row.size, row.media_type))
    return MadeFile(problem=None if row.problem is None else FailureReason(**row.problem))


def claim_making(
    conn: sa.Connection,
    tenant: str,
    motion: UUID,
    *,
    source: str,
    key: str,
    format: str,
    rig: RigRow | None = None,
) -> MakingClaim | None:
    """Claim the making of a file; None if it is there, another process makes it, or the motion
    has no such npz or the tenant no such version of the rig any more."""
    motions = {"tenant": tenant, "motion": motion, "canonical": CANONICAL, "source": source}
    values = {"key": key, "format": format, "claim": uuid4(), "seconds": CLAIM_SECONDS}
    values |= {"rig": None if rig is None else rig.id, "rig_version": None if rig is None else rig.version}
    token = conn.execute(CLAIM, {**motions, **values}).scalar_one_or_none()
    return None if token is None else MakingClaim(tenant, motion, source, key, format, token)


def renew_makings(engine: sa.Engine, tokens: Collection[UUID]) -> None:
    """Renew claims.

    Raises:
        Unreachable: the database does not answer.
    """
    table = tables.made_file
    with transaction(engine, HEARTBEAT) as conn:
        conn.execute(
            sa.update(table).where(among(table.c.claim, tokens)).values(expires_at=CLOCK + interval(CLAIM_SECONDS))
        )


def release_makings(engine: sa.Engine, tokens: Collection[UUID]) -> None:
    """Give up claims: the next request makes the files.

    Raises:
        Unreachable: the database does not answer.
    """
    with transaction(engine) as conn:
        conn.execute(sa.delete(tables.made_file).where(among(tables.made_file.c.claim, tokens)))


def fail_making(engine: sa.Engine, claim: MakingClaim, problem: FailureReason) -> None:
    """Record why a file cannot be made, for a while; without effect on a claim that is lost.

    Raises:
        Unreachable: the database does not answer.
    """
    with transaction(engine) as conn:
        conn.execute(
            sa.update(tables.made_file)
            .where(_row_of(claim))
            .values(claim=None, problem=document(problem), expires_at=CLOCK + interval(FAILURE_SECONDS))
        )


def keep_made(
    engine: sa.Engine, store: WritableStore, claim: MakingClaim, data: bytes, media_type: str, *, quota: int
) -> bool:
    """Store a file that was made, and remove the tenant's oldest beyond the quota; the new one stays in any case.

    Args:
        quota: bytes of the tenant's made files.

    Returns:
        False if nothing was stored: the motion was deleted, its prompt erased, or the claim lost.

    Raises:
        Unreachable: the store or the database does not answer; the content is removed as garbage.
    """
    for _ in range(ATTEMPTS):
        sha256 = write_content(engine, store, claim.tenant, data, media_type)
        with transaction(engine, MAINTENANCE) as conn:
            wanted = _still_wanted(conn, claim)
            asset = keep_content(conn, claim.tenant, sha256)
            if wanted and asset is not None:
                _record(conn, claim, asset, len(data))
                unused = _evict(conn, claim, quota)
            else:
                unused = [asset] if asset is not None else []
        remove_assets(engine, store, unused)
        if not wanted or asset is not None:
            return wanted
    raise Unreachable("garbage collection removed the same new file several times", where="store")


def remove_expired_makings(engine: sa.Engine) -> int:
    """Remove claims of processes that died and failures of long ago; return their number.

    Raises:
        Unreachable: the database does not answer.
    """
    table = tables.made_file.c
    with transaction(engine, MAINTENANCE) as conn:
        late = table.expires_at < CLOCK - interval(EXPIRED_KEPT)
        return conn.execute(sa.delete(tables.made_file).where(late)).rowcount


def _row_of(claim: MakingClaim) -> sa.ColumnElement[bool]:
    table = tables.made_file.c
    return (table.motion_id == claim.motion) & (table.key == claim.key) & (table.claim == claim.token)


def _still_wanted(conn: sa.Connection, claim: MakingClaim) -> bool:
    """Lock the motion with the npz that the file was made of, and the claim; return False if one of them is gone."""
    source = {"motion": claim.motion, "format": CANONICAL, "sha256": claim.source}
    if conn.execute(HOLD_SOURCE, source).one_or_none() is None:
        return False
    mine = sa.select(tables.made_file.c.key).where(_row_of(claim)).with_for_update()
    return conn.execute(mine).one_or_none() is not None


def _record(conn: sa.Connection, claim: MakingClaim, asset: UUID, size: int) -> None:
    values = {"asset_id": asset, "size": size, "claim": None, "expires_at": None, "made_at": CLOCK}
    conn.execute(sa.update(tables.made_file).where(_row_of(claim)).values(**values))


def _evict(conn: sa.Connection, claim: MakingClaim, quota: int) -> Sequence[UUID]:
    """Remove the tenant's oldest files beyond the quota, but not that of the claim; return their assets."""
    conn.execute(sa.select(sa.func.pg_advisory_xact_lock(MADE_LOCK, sa.func.hashtext(claim.tenant))))
    values = {"tenant": claim.tenant, "motion": claim.motion, "key": claim.key, "quota": quota}
    return conn.execute(EVICT, values).scalars().all()
