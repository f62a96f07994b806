"""Rigs of a tenant: the file of a character under a name. Adding is idempotent; another file is a new version."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any
from uuid import UUID

import sqlalchemy as sa

from marey.core.errors import Conflict, NotFound, Unreachable
from marey.db.database import transaction
from marey.db.deadlines import MAINTENANCE
from marey.db.ids import new_id
from marey.db.pages import PAGE, Order, Page
from marey.db.sql import CLOCK, need_row
from marey.jobs import tables
from marey.takes.assets import keep_content, write_content
from marey.takes.gc import remove_assets
from marey.takes.made import ATTEMPTS, WritableStore
from marey.takes.types import AddedRig, NewRig, RigRow
from marey.tenants import Actor, audit
from marey.tenants.quotas import reserve_bytes

MEDIA_TYPE = "application/octet-stream"
RIG_LOCK = 0x7269_6773
"""First key of the advisory locks under which a tenant's rigs are counted and changed."""


def add_rig(engine: sa.Engine, store: WritableStore, new: NewRig, actor: Actor, *, limit: int) -> AddedRig:
    """Store a rig under its name, as a new version if there is another one.

    Args:
        limit: largest number of rigs of a tenant.

    Raises:
        Conflict: the tenant has as many rigs as it may.
        QuotaUsedUp: its quota of bytes is exhausted.
        Unreachable: the store or the database does not answer.
    """
    for _ in range(ATTEMPTS):
        sha256 = write_content(engine, store, new.tenant, new.data, MEDIA_TYPE)
        with transaction(engine, MAINTENANCE) as conn:
            before = _lock(conn, new, sha256, limit)
            asset = keep_content(conn, new.tenant, sha256)
            if asset is None:
                continue
            changed = before is None or not _same(before, new, sha256)
            _write(conn, new, asset, actor, before=before, changed=changed)
            rig = get_rig(conn, new.tenant, new.name)
            audit(conn, new.tenant, actor, "rig.add", new.name, version=rig.version, sha256=sha256)
        if before is not None and before.sha256 != sha256:
            remove_assets(engine, store, [before.asset])
        return AddedRig(rig, changed)
    raise Unreachable("garbage collection removed the same new file several times", where="store")


def list_rigs(conn: sa.Connection, tenant: str, *, cursor: str | None = None, limit: int = PAGE) -> Page[RigRow]:
    """Return rigs, newest first."""
    table = tables.rig.c
    ours = table.tenant_id == tenant
    query, order = rigs_query().where(ours), Order(table.created_at, table.id)
    return order.page(conn, query, ours, cursor, limit, lambda row: RigRow(**row))


def get_rig(conn: sa.Connection, tenant: str, name: str) -> RigRow:
    """Return a rig.

    Raises:
        NotFound: the tenant has no such rig.
    """
    table = tables.rig.c
    query = rigs_query().where(table.tenant_id == tenant, table.name == name)
    return RigRow(**need_row(conn, query, _no_rig(name)))


def remove_rig(conn: sa.Connection, tenant: str, name: str) -> UUID:
    """Remove a rig with the files that were made on it; return its asset, which may be unused now.

    Raises:
        NotFound: the tenant has no such rig.
    """
    lock_rigs(conn, tenant)
    table = tables.rig.c
    statement = sa.delete(tables.rig).where(table.tenant_id == tenant, table.name == name).returning(table.asset_id)
    asset: UUID | None = conn.execute(statement).scalar_one_or_none()
    if asset is None:
        raise _no_rig(name)
    return asset


@dataclass(frozen=True)
class _Before:
    id: UUID
    asset: UUID
    sha256: str
    format: str
    map: Mapping[str, str | None] | None


def lock_rigs(conn: sa.Connection, tenant: str) -> None:
    """Lock the names of a tenant's rigs until the transaction ends."""
    conn.execute(sa.select(sa.func.pg_advisory_xact_lock(RIG_LOCK, sa.func.hashtext(tenant))))


def _lock(conn: sa.Connection, new: NewRig, sha256: str, limit: int) -> _Before | None:
    """Lock the rigs of the tenant, and check its limits; return the rig that has the name."""
    lock_rigs(conn, new.tenant)
    table, asset = tables.rig.c, tables.asset.c
    query = (
        sa.select(table.id, table.asset_id.label("asset"), asset.sha256, table.format, table.map)
        .join(tables.asset, asset.id == table.asset_id)
        .where(table.tenant_id == new.tenant, table.name == new.name)
    )
    row = conn.execute(query).mappings().one_or_none()
    before = None if row is None else _Before(**row)
    if before is None:
        _check_count(conn, new.tenant, limit)
    if before is None or before.sha256 != sha256:
        reserve_bytes(conn, new.tenant, len(new.data))
    return before


def _check_count(conn: sa.Connection, tenant: str, limit: int) -> None:
    count = conn.execute(sa.select(sa.func.count()).where(tables.rig.c.tenant_id == tenant)).scalar_one()
    if count >= limit:
        raise Conflict(
            f"there are {count} rigs, and {limit} are allowed",
            where="name",
            hint="Remove one with `marey rigs remove NAME`, or ask the operator for more (MAREY_RIGS_PER_TENANT).",
        )


def _same(before: _Before, new: NewRig, sha256: str) -> bool:
    return (before.sha256, before.format, before.map) == (sha256, new.format, new.map)


def _write(
    conn: sa.Connection, new: NewRig, asset: UUID, actor: Actor, *, before: _Before | None, changed: bool
) -> None:
    table = tables.rig
    values = {"format": new.format, "asset_id": asset, "map": sa.null() if new.map is None else dict(new.map)}
    values["report"] = dict(new.report)
    if before is None:
        conn.execute(
            sa.insert(table).values(id=new_id(), tenant_id=new.tenant, name=new.name, added_by=actor.name, **values)
        )
        return
    if changed:
        values |= {"version": table.c.version + 1, "added_by": actor.name, "updated_at": CLOCK}
    conn.execute(sa.update(table).where(table.c.id == before.id).values(**values))
    if changed:
        conn.execute(sa.delete(tables.made_file).where(tables.made_file.c.rig_id == before.id))


def rigs_query() -> sa.Select[*tuple[Any, ...]]:
    """Return a query for the fields of `RigRow` of all rigs."""
    table, asset = tables.rig.c, tables.asset.c
    return sa.select(
        *(table.id, table.name, table.version, table.format, asset.sha256, asset.size, table.map, table.report),
        *(table.added_by, table.created_at.label("created"), table.updated_at.label("updated")),
    ).join(tables.asset, asset.id == table.asset_id)


def _no_rig(name: str) -> NotFound:
    hint = "`marey rigs list` shows them; `marey rigs add FILE` adds one."
    return NotFound(f"there is no rig {name!r}", where="rig", hint=hint)
