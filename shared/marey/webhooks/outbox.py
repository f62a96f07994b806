"""The transactional outbox: webhook events are written in the transaction of the change.

Events hold ids, states and counters; never a name, a prompt or an error's text, which may quote one.
"""

from __future__ import annotations

import json
from collections.abc import Mapping

import sqlalchemy as sa

from marey.db.ids import new_id
from marey.webhooks.types import EventKind

SUBSCRIBED = sa.text("SELECT EXISTS (SELECT FROM webhook WHERE tenant_id = :tenant AND :kind = ANY(events))")
# A webhook that is being deleted is waited for, and then gone: its deliveries could not refer to it.
WRITE = sa.text("""
    WITH wanted AS MATERIALIZED (
        SELECT id FROM webhook WHERE tenant_id = :tenant AND :kind = ANY(events) ORDER BY id FOR KEY SHARE
    ), event AS (
        INSERT INTO webhook_event (id, tenant_id, kind, data, at)
        SELECT :event, :tenant, :kind, CAST(:data AS jsonb), clock_timestamp() WHERE EXISTS (SELECT FROM wanted)
        RETURNING at
    )
    INSERT INTO webhook_delivery (webhook_id, event_id, next_at, created_at)
    SELECT wanted.id, :event, clock_timestamp(), event.at FROM wanted, event
""")


def is_subscribed(conn: sa.Connection, tenant: str, kind: EventKind) -> bool:
    """Return True if a webhook of the tenant subscribes to a kind of event."""
    return conn.execute(SUBSCRIBED, {"tenant": tenant, "kind": str(kind)}).scalar_one()


def enqueue_event(conn: sa.Connection, tenant: str, kind: EventKind, data: Mapping[str, object]) -> None:
    """Write an event for the tenant's webhooks that subscribe to its kind; no row without a subscriber."""
    values = {"tenant": tenant, "kind": str(kind), "event": new_id(), "data": json.dumps(data, default=str)}
    conn.execute(WRITE, values)
