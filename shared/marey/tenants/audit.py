"""The audit log: actor, key, verb and time of each change. Written in the transaction of the change; holds no
prompts."""

from __future__ import annotations

from datetime import datetime
from typing import Any
from uuid import UUID

import sqlalchemy as sa

from marey.db.ids import new_id
from marey.db.pages import PAGE, Order, Page
from marey.db.sql import CLOCK
from marey.tenants import tables
from marey.tenants.types import Actor, AuditRow


def audit(conn: sa.Connection, tenant: str, actor: Actor, verb: str, target: object, **data: object) -> None:
    """Record an action.

    Args:
        verb: noun and verb: "job.cancel".
        target: identifier of the changed object.
        data: details (a count, a priority); never a prompt, never a secret.
    """
    conn.execute(
        sa.insert(tables.audit_event).values(
            id=new_id(),
            at=CLOCK,
            tenant_id=tenant,
            key_id=actor.key,
            actor=actor.name,
            verb=verb,
            target=str(target),
            data={name: value for name, value in data.items() if value is not None},
        )
    )


def list_audit(
    conn: sa.Connection,
    *,
    tenant: str | None = None,
    key: UUID | None = None,
    verb: str | None = None,
    since: datetime | None = None,
    cursor: str | None = None,
    limit: int = PAGE,
) -> Page[AuditRow]:
    """Return recorded actions, newest first, filtered by key, verb and tenant.

    Args:
        verb: "job.cancel", or a noun: "job".
    """
    table = tables.audit_event.c
    ours = sa.true() if tenant is None else table.tenant_id == tenant
    query, order = _rows().where(ours), Order(table.at, table.id)
    if key is not None:
        query = query.where(table.key_id == key)
    if verb is not None:
        query = query.where((table.verb == verb) | table.verb.startswith(f"{verb}.", autoescape=True))
    if since is not None:
        query = query.where(table.at >= since)
    return order.page(conn, query, ours, cursor, limit, lambda row: AuditRow(**row), mark=lambda row: (row.at, row.id))


def _rows() -> sa.Select[*tuple[Any, ...]]:
    table = tables.audit_event.c
    return sa.select(
        *(table.id, table.at, table.tenant_id.label("tenant"), table.key_id.label("key")),
        *(table.actor, table.verb, table.target, table.data),
    )
