"""Webhook subscriptions. Signing secrets are encrypted before they reach this module."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any
from uuid import UUID

import sqlalchemy as sa

from marey.core.errors import Conflict, InvalidInput, NotFound
from marey.db.ids import new_id
from marey.db.pages import PAGE, Order, Page
from marey.db.sql import CLOCK, check_text, interval, need_row
from marey.tenants import tables
from marey.webhooks.tables import webhook, webhook_delivery
from marey.webhooks.types import DeliveryState, EventKind, NewWebhook, WebhookChange, WebhookRow

MAX_WEBHOOKS = 20
"""Limit per tenant: each event is written once for each subscribed webhook."""
OVERLAP, LONGEST_OVERLAP = 86_400.0, 30 * 86_400.0
"""Seconds that a rotated signing secret is still used: a day to update the receiver."""


def create_webhook(conn: sa.Connection, new: NewWebhook) -> UUID:
    """Create a webhook; it receives events from now on.

    Raises:
        InvalidInput: no events, or text that the database cannot hold.
        Conflict: the tenant has the maximum number of webhooks.
    """
    check_text(new.name, "name")
    check_text(new.url, "url")
    # The tenant's row is the lock: concurrent requests count one after the other.
    tenant = tables.tenant.c
    conn.execute(sa.select(tenant.id).where(tenant.id == new.tenant).with_for_update(key_share=True))
    mine = sa.select(sa.func.count()).select_from(webhook).where(webhook.c.tenant_id == new.tenant)
    if conn.execute(mine).scalar_one() >= MAX_WEBHOOKS:
        raise Conflict(f"the limit of {MAX_WEBHOOKS} webhooks is reached", hint="Remove one first.")
    identifier = new_id()
    conn.execute(
        sa.insert(webhook).values(
            id=identifier,
            tenant_id=new.tenant,
            name=new.name,
            url=new.url,
            events=_kinds(new.events),
            secret=new.secret,
        )
    )
    return identifier


def get_webhook(conn: sa.Connection, tenant: str, identifier: UUID) -> WebhookRow:
    """Return one webhook.

    Raises:
        NotFound: the tenant has no such webhook.
    """
    table = webhook.c
    query = _webhooks().where(table.tenant_id == tenant, table.id == identifier)
    return _row(need_row(conn, query, no_such_webhook(identifier)))


def list_webhooks(
    conn: sa.Connection, tenant: str, *, cursor: str | None = None, limit: int = PAGE
) -> Page[WebhookRow]:
    """Return webhooks, newest first."""
    table = webhook.c
    ours = table.tenant_id == tenant
    query, order = _webhooks().where(ours), Order(table.created_at, table.id)
    return order.page(conn, query, ours, cursor, limit, _row)


def change_webhook(conn: sa.Connection, tenant: str, identifier: UUID, change: WebhookChange) -> WebhookRow:
    """Change a webhook. While it is paused its deliveries wait; afterwards they go to its current URL.

    Raises:
        NotFound: the tenant has no such webhook.
        InvalidInput: no events, or text that the database cannot hold.
    """
    check_text(change.name, "name")
    check_text(change.url, "url")
    values: dict[str, Any] = {
        name: value
        for name, value in (("url", change.url), ("name", change.name), ("paused", change.paused))
        if value is not None
    }
    if change.events is not None:
        values["events"] = _kinds(change.events)
    table = webhook.c
    if values:
        ours = sa.update(webhook).where(table.tenant_id == tenant, table.id == identifier)
        conn.execute(ours.values(values))
    return get_webhook(conn, tenant, identifier)


def rotate_secret(
    conn: sa.Connection, tenant: str, identifier: UUID, secret: bytes, *, overlap: float = OVERLAP
) -> WebhookRow:
    """Sign with a new secret, and with the current one until the overlap ends; older secrets are dropped.

    Args:
        secret: encrypted.
        overlap: seconds; 0 = only the new secret is used from now on.

    Raises:
        NotFound: the tenant has no such webhook.
        InvalidInput: an invalid overlap.
    """
    if not 0 <= overlap <= LONGEST_OVERLAP:
        raise InvalidInput(f"{overlap:g} seconds are not a valid duration", where="overlap", hint="Up to 30 days.")
    table = webhook.c
    kept = {"previous_secret": table.secret, "previous_until": CLOCK + interval(overlap)}
    values = {"previous_secret": None, "previous_until": None} if overlap == 0 else kept
    ours = sa.update(webhook).where(table.tenant_id == tenant, table.id == identifier)
    conn.execute(ours.values(secret=secret, **values))
    return get_webhook(conn, tenant, identifier)


def delete_webhook(conn: sa.Connection, tenant: str, identifier: UUID) -> None:
    """Remove a webhook, with its deliveries and their log.

    Raises:
        NotFound: the tenant has no such webhook.
    """
    table = webhook.c
    gone = conn.execute(sa.delete(webhook).where(table.tenant_id == tenant, table.id == identifier))
    if gone.rowcount == 0:
        raise no_such_webhook(identifier)


def no_such_webhook(identifier: UUID) -> NotFound:
    """Return the error for a webhook that does not exist, or belongs to another tenant."""
    return NotFound(
        "there is no such webhook", where=f"webhook {identifier}", hint="`marey webhooks list` shows yours."
    )


def _kinds(events: Sequence[EventKind]) -> list[str]:
    if not events:
        raise InvalidInput("is empty", where="events", hint=f"There are {', '.join(EventKind)}.")
    return sorted({str(kind) for kind in events})


def _webhooks() -> sa.Select[*tuple[Any, ...]]:
    c, delivery = webhook.c, webhook_delivery.c

    def count(state: DeliveryState) -> sa.ScalarSelect[int]:
        query = sa.select(sa.func.count()).select_from(webhook_delivery)
        return query.where(delivery.webhook_id == c.id, delivery.state == state).scalar_subquery()

    return sa.select(
        *(c.id, c.tenant_id.label("tenant"), c.name, c.url, c.events, c.paused),
        count(DeliveryState.PENDING).label("pending"),
        count(DeliveryState.FAILED).label("failed"),
        c.created_at.label("created"),
    )


def _row(row: sa.RowMapping) -> WebhookRow:
    values: dict[str, Any] = dict(row)
    values["events"] = tuple(EventKind(kind) for kind in row["events"])
    return WebhookRow(**values)
