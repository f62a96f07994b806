"""Garbage collection of assets, under lock."""

from __future__ import annotations

import itertools
import re
from collections.abc import Collection, Iterator, Sequence
from typing import Protocol
from uuid import UUID

import sqlalchemy as sa
from sqlalchemy.dialects.postgresql import insert

from marey.db.database import transaction
from marey.db.deadlines import MAINTENANCE
from marey.db.ids import new_id
from marey.db.sql import CLOCK, among, interval
from marey.evaluations import tables as evaluation_tables
from marey.jobs import tables as job_tables
from marey.jobs.files import asset_key
from marey.jobs.policy import Policy, policy
from marey.takes.types import GarbageReport
from marey.tenants import tables as tenant_tables

KEY = re.compile(r"t/([^/]+)/[0-9a-f]{2}/([0-9a-f]{64})")
PAGE = 500


class ObjectStore(Protocol):
    """Methods of an asset store that garbage collection needs (`marey.storage.AssetStore` fits)."""

    def delete(self, key: str) -> None: ...
    def keys(self, prefix: str = "") -> Iterator[str]: ...


def collect_garbage(engine: sa.Engine, store: ObjectStore) -> GarbageReport:
    """Remove unreferenced assets (unless a live lease announced them), and objects without a row.

    Each removal holds the lock of its asset row, so that a worker about to write the same content waits and writes
    it again. Keys outside `t/` belong to other programs and stay.

    Raises:
        Unreachable: the store or the database does not answer; what was removed until then stays removed.
    """
    rows = _remove_unreferenced(engine, store, _unreferenced())
    orphans = 0
    found: set[str] = set()
    keys = (key for key in store.keys("t/") if KEY.fullmatch(key))
    for page in iter(lambda: list(itertools.islice(keys, PAGE)), []):
        known = _known(engine, page)
        found |= known
        for key in page:
            orphans += key not in known and _remove_orphan(engine, store, key)
    return GarbageReport(rows=rows, orphans=orphans, missing=_missing(engine, store, found))


def remove_stale_assets(engine: sa.Engine, store: ObjectStore, *, rules: Policy | None = None) -> int:
    """Remove assets that are still `writing` an hour after they were announced and whose lease is gone; for the
    sweeper.

    Raises:
        Unreachable: the store or the database does not answer.
    """
    grace = (rules or policy()).asset_grace
    stale = (job_tables.asset.c.state == "writing") & (job_tables.asset.c.announced_at < CLOCK - interval(grace))
    return _remove_unreferenced(engine, store, _unreferenced() & stale)


def remove_unused_assets(engine: sa.Engine, store: ObjectStore) -> int:
    """Remove stored assets without references; return their number. Objects without a row are left to
    `collect_garbage`.

    Raises:
        Unreachable: the store or the database does not answer; the rest is removed the next time.
    """
    return _remove_unreferenced(engine, store, _unreferenced() & (job_tables.asset.c.state == "stored"))


def remove_assets(engine: sa.Engine, store: ObjectStore, assets: Collection[UUID]) -> int:
    """Remove those of these assets that have no references; return their number.

    Raises:
        Unreachable: the store or the database does not answer; `collect_garbage` removes the rest.
    """
    if not assets:
        return 0
    return _remove_unreferenced(engine, store, _unreferenced() & among(job_tables.asset.c.id, assets))


def _unreferenced() -> sa.ColumnElement[bool]:
    asset = job_tables.asset.c.id
    return ~(
        sa.exists().where(job_tables.motion_file.c.asset_id == asset)
        | sa.exists().where(job_tables.made_file.c.asset_id == asset)
        | sa.exists().where(job_tables.rig.c.asset_id == asset)
        | sa.exists().where(evaluation_tables.evaluation_report.c.asset_id == asset)
        | sa.exists().where(job_tables.asset_writer.c.asset_id == asset)
    )


def _remove_unreferenced(engine: sa.Engine, store: ObjectStore, condition: sa.ColumnElement[bool]) -> int:
    table = job_tables.asset.c
    with transaction(engine, MAINTENANCE) as conn:
        candidates: Sequence[UUID] = conn.execute(sa.select(table.id).where(condition)).scalars().all()
    removed = 0
    for candidate in candidates:
        with transaction(engine, MAINTENANCE) as conn:
            # Lock the row first, then check: earlier announcements are seen now, later ones wait.
            row = conn.execute(
                sa.select(table.tenant_id, table.sha256).where(table.id == candidate).with_for_update()
            ).one_or_none()
            still = conn.execute(sa.select(table.id).where(table.id == candidate, condition)).one_or_none()
            if row is None or still is None:
                continue
            store.delete(asset_key(row.tenant_id, row.sha256))
            conn.execute(sa.delete(job_tables.asset).where(table.id == candidate))
            removed += 1
    return removed


def _known(engine: sa.Engine, keys: Sequence[str]) -> set[str]:
    table = job_tables.asset.c
    digests = [key.rpartition("/")[2] for key in keys]
    with transaction(engine, MAINTENANCE) as conn:
        rows = conn.execute(sa.select(table.tenant_id, table.sha256).where(among(table.sha256, digests))).all()
    return {asset_key(row.tenant_id, row.sha256) for row in rows}


def _remove_orphan(engine: sa.Engine, store: ObjectStore, key: str) -> bool:
    """Remove an object without a row, behind a temporary row of its own."""
    found = KEY.fullmatch(key)
    assert found is not None
    tenant, sha256 = found.groups()
    with transaction(engine, MAINTENANCE) as conn:
        known = conn.execute(
            sa.select(tenant_tables.tenant.c.id).where(tenant_tables.tenant.c.id == tenant)
        ).one_or_none()
        if known is None:
            store.delete(key)
            return True
        values = {"id": new_id(), "tenant_id": tenant, "sha256": sha256, "size": 0, "media_type": ""}
        ours = conn.execute(
            insert(job_tables.asset)
            .values(**values, state="writing", announced_at=CLOCK)
            .on_conflict_do_nothing()
            .returning(job_tables.asset.c.id)
        ).scalar_one_or_none()
        if ours is None:
            return False  # announced since the listing
        store.delete(key)
        conn.execute(sa.delete(job_tables.asset).where(job_tables.asset.c.id == ours))
    return True


def _missing(engine: sa.Engine, store: ObjectStore, found: set[str]) -> tuple[str, ...]:
    """Return the keys of stored assets that the listing lacked, and that are still stored."""
    table = job_tables.asset.c
    with transaction(engine, MAINTENANCE) as conn:
        rows = conn.execute(sa.select(table.tenant_id, table.sha256).where(table.state == "stored")).all()
    lacking = {asset_key(row.tenant_id, row.sha256) for row in rows} - found
    if not lacking:
        return ()
    return tuple(sorted(lacking - set(store.keys("t/"))))  # stored after the listing: not lost
