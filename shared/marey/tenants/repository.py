"""Tenants: their quotas, and suspension."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import sqlalchemy as sa
from sqlalchemy.dialects.postgresql import insert

from marey.core.errors import Conflict, InvalidInput, NotFound
from marey.db.sql import CLOCK, need_row
from marey.tenants import tables
from marey.tenants.types import Quotas, TenantRow

FORM = re.compile(r"[a-z0-9][a-z0-9_-]{0,62}")
LARGEST = {"queued": 2**31 - 1, "running": 2**31 - 1, "bytes": 2**63 - 1, "streams": 2**31 - 1}
COLUMNS = {name: f"max_{name}" for name in LARGEST}


def create_tenant(conn: sa.Connection, tenant: str, quotas: Quotas | None = None) -> TenantRow:
    """Create a tenant.

    Args:
        tenant: its name, part of its files' keys.

    Raises:
        InvalidInput: an invalid name or quota.
        Conflict: the name is taken.
    """
    if not FORM.fullmatch(tenant):
        raise InvalidInput(
            f"{tenant[:80]!r} is not a valid tenant name",
            where="tenant",
            hint="1 to 63 small letters, digits, - and _; the first is a letter or digit.",
        )
    values = _columns(asdict(quotas or Quotas()))
    new = insert(tables.tenant).values(id=tenant, **values).on_conflict_do_nothing().returning(tables.tenant.c.id)
    if conn.execute(new).one_or_none() is None:
        raise Conflict("the tenant already exists", where=f"tenant {tenant}")
    return get_tenant(conn, tenant)


def get_tenant(conn: sa.Connection, tenant: str) -> TenantRow:
    """Return one tenant.

    Raises:
        NotFound: there is none of that name.
    """
    return _row(need_row(conn, _tenants().where(tables.tenant.c.id == tenant), no_such_tenant(tenant)))


def list_tenants(conn: sa.Connection) -> list[TenantRow]:
    """Return all tenants, by name."""
    return [_row(row) for row in conn.execute(_tenants().order_by(tables.tenant.c.id)).mappings()]


def set_quotas(conn: sa.Connection, tenant: str, changes: Mapping[str, int | None]) -> TenantRow:
    """Change quotas, by the names of `Quotas`; None removes one. Use above a new quota stays.

    Raises:
        NotFound: there is no such tenant.
        InvalidInput: an invalid quota.
    """
    get_tenant(conn, tenant)
    values = _columns(changes)
    if values:
        conn.execute(sa.update(tables.tenant).where(tables.tenant.c.id == tenant).values(values))
    return get_tenant(conn, tenant)


def suspend_tenant(conn: sa.Connection, tenant: str) -> TenantRow:
    """Suspend a tenant: refuse its requests and claim none of its items; running items are finished. Its live streams
    lose their viewers, and end by themselves. Suspended already: no change.

    Raises:
        NotFound: there is no such tenant.
    """
    table = tables.tenant
    values = {"suspended_at": sa.func.coalesce(table.c.suspended_at, CLOCK)}
    conn.execute(sa.update(table).where(table.c.id == tenant).values(values))
    return get_tenant(conn, tenant)


def reinstate_tenant(conn: sa.Connection, tenant: str) -> TenantRow:
    """End a suspension; the tenant's jobs continue. Not suspended: no change.

    Raises:
        NotFound: there is no such tenant.
    """
    conn.execute(sa.update(tables.tenant).where(tables.tenant.c.id == tenant).values(suspended_at=None))
    return get_tenant(conn, tenant)


def no_such_tenant(tenant: str) -> NotFound:
    """Return the error for a tenant that does not exist."""
    return NotFound("there is no such tenant", where=f"tenant {tenant}", hint="`marey admin tenants list` shows them.")


def _columns(quotas: Mapping[str, int | None]) -> dict[str, int | None]:
    for name, value in quotas.items():
        if value is not None and not 0 <= value <= LARGEST[name]:
            raise InvalidInput(f"{value} is not between 0 and {LARGEST[name]}", where=name)
    return {COLUMNS[name]: value for name, value in quotas.items()}


def _tenants() -> sa.Select[*tuple[Any, ...]]:
    table = tables.tenant.c
    return sa.select(
        table.id,
        table.created_at.label("created"),
        table.suspended_at.label("suspended"),
        *(table[column].label(name) for name, column in COLUMNS.items()),
    )


def _row(row: sa.RowMapping) -> TenantRow:
    return TenantRow(row["id"], row["created"], row["suspended"], Quotas(**{name: row[name] for name in COLUMNS}))
