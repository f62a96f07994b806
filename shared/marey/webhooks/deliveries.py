"""Deliveries of events to webhooks: claimed, attempted, recorded, replayed. At least once, under one id.

A claim is a lease by time: a process that dies loses it after `HOLD` seconds, and another one tries again. It fences
the record of the attempt, so that of two concurrent attempts one is recorded.
"""

from __future__ import annotations

import random
from collections.abc import Collection, Mapping, Sequence
from typing import Any
from uuid import UUID

import sqlalchemy as sa

from marey.core.errors import Conflict, NotFound
from marey.db.ids import new_id
from marey.db.pages import PAGE, Order, Page
from marey.db.sql import CLOCK, interval, need_row
from marey.tenants.audit import audit
from marey.tenants.types import Actor
from marey.webhooks.repository import get_webhook
from marey.webhooks.tables import webhook, webhook_attempt, webhook_delivery, webhook_event
from marey.webhooks.types import (
    TEST_KIND,
    Attempt,
    AttemptRow,
    DeliveryRow,
    DeliveryState,
    DueDelivery,
    WebhookRow,
)

DELAYS = (5, 60, 600, 3600, 12_600, 25_200, 43_200)
"""Seconds between the eight attempts: 23.7 hours in total."""
JITTER = 0.1
"""Jitter of delays, so that a recovering receiver is not hit by all at once."""
HOLD = 60.0
"""Seconds of a claim: well beyond the longest attempt."""
MAX_WAIT = 43_200.0
"""Limit of the delay that a receiver may ask for: the longest delay."""
GONE = 410
"""Status by which a receiver unsubscribes for good."""
DELIVERER = Actor("webhooks")
"""Actor of such a pause in the audit log."""
MAX_ERROR = 300
"""Characters of an error in the log."""
KEPT = 30 * 86_400.0
"""Retention of events in seconds, delivered or not."""

# A few from each webhook, so that one with thousands does not block the others. Only the claimed rows are locked; a row
# that another process claimed since the first read is no longer due in the second.
CLAIM = sa.text("""
    WITH wanted AS MATERIALIZED (
        SELECT due.webhook_id, due.event_id
        FROM webhook
        LEFT JOIN unnest(CAST(:busy AS uuid[]), CAST(:counts AS int[])) AS busy (id, count) ON busy.id = webhook.id
        CROSS JOIN LATERAL (
            SELECT webhook_id, event_id, next_at FROM webhook_delivery
            WHERE webhook_id = webhook.id AND state = 'pending' AND next_at <= now()
            ORDER BY next_at LIMIT greatest(0, :each - coalesce(busy.count, 0))
        ) AS due
        WHERE NOT webhook.paused
        ORDER BY due.next_at LIMIT :limit
    ), picked AS MATERIALIZED (
        SELECT webhook_id, event_id FROM webhook_delivery JOIN wanted USING (webhook_id, event_id)
        WHERE state = 'pending' AND next_at <= now()
        FOR UPDATE OF webhook_delivery SKIP LOCKED
    ), claimed AS (
        UPDATE webhook_delivery AS delivery
        SET claim = :claim, next_at = clock_timestamp() + make_interval(secs => :hold)
        FROM picked WHERE (delivery.webhook_id, delivery.event_id) = (picked.webhook_id, picked.event_id)
        RETURNING delivery.webhook_id, delivery.event_id, delivery.tries
    )
    SELECT claimed.webhook_id, claimed.event_id, event.kind, event.at, event.data, webhook.url,
           CASE WHEN webhook.previous_until > now() THEN ARRAY[webhook.secret, webhook.previous_secret]
                ELSE ARRAY[webhook.secret] END, claimed.tries
    FROM claimed JOIN webhook ON webhook.id = claimed.webhook_id JOIN webhook_event AS event
         ON event.id = claimed.event_id
    ORDER BY event.at, event.id
""")


def claim_deliveries(
    conn: sa.Connection, limit: int, *, each: int, busy: Mapping[UUID, int] | None = None, hold: float = HOLD
) -> list[DueDelivery]:
    """Claim due deliveries: at most `limit`, and per webhook no more than `each`, counting those in flight (`busy`)."""
    token, busy = new_id(), busy or {}
    values = {"claim": token, "limit": limit, "each": each, "busy": list(busy), "counts": list(busy.values())}
    return [DueDelivery(token, *row) for row in conn.execute(CLAIM, {**values, "hold": hold})]


def record_attempt(conn: sa.Connection, due: DueDelivery, attempt: Attempt) -> DeliveryState | None:
    """Record the result of an attempt and return the delivery's new state; None if the claim was lost and nothing was
    written.

    A receiver that is gone gets no more messages: its webhook is paused, which the audit log records.
    """
    tries = due.tries + 1
    gone = attempt.status == GONE
    if gone:  # before its deliveries, in the same order as a deletion
        conn.execute(sa.select(webhook.c.id).where(webhook.c.id == due.webhook).with_for_update(key_share=True))
    state = _state_after(due, attempt)
    ended = state is not DeliveryState.PENDING
    values: dict[str, Any] = {
        "claim": None,
        "tries": tries,
        "attempts": webhook_delivery.c.attempts + 1,
        "state": state,
        "next_at": None if ended else CLOCK + interval(max(delay_after(tries), min(attempt.wait, MAX_WAIT))),
        "ended_at": CLOCK if ended else None,
    }
    table = webhook_delivery.c
    ours = _is(due.webhook, due.event) & (table.claim == due.claim)
    number = conn.execute(
        sa.update(webhook_delivery).where(ours).values(values).returning(table.attempts)
    ).scalar_one_or_none()
    if number is None:
        return None
    conn.execute(
        sa.insert(webhook_attempt).values(
            webhook_id=due.webhook,
            event_id=due.event,
            number=number,
            at=CLOCK,
            status=attempt.status,
            seconds=attempt.seconds,
            error=None if attempt.error is None else attempt.error[:MAX_ERROR],
        )
    )
    if gone:
        _pause_gone(conn, due)
    return state


def _state_after(due: DueDelivery, attempt: Attempt) -> DeliveryState:
    """Return the state of a delivery after an attempt: one that failed is tried again, but not a test, nor at a
    receiver that is gone, nor after the last of `DELAYS`."""
    if attempt.error is None:
        return DeliveryState.DELIVERED
    is_last = due.tries + 1 > len(DELAYS)
    return DeliveryState.FAILED if attempt.status == GONE or due.kind == TEST_KIND or is_last else DeliveryState.PENDING


def delay_after(tries: int) -> float:
    """Return the delay in seconds before the next attempt."""
    return DELAYS[tries - 1] * random.uniform(1 - JITTER, 1 + JITTER)  # noqa: S311


def give_back_deliveries(conn: sa.Connection, due: Sequence[DueDelivery]) -> None:
    """Release unused claims: their deliveries are due again, and no attempt is counted."""
    for each in due:
        ours = _is(each.webhook, each.event) & (webhook_delivery.c.claim == each.claim)
        conn.execute(sa.update(webhook_delivery).where(ours).values(claim=None, next_at=CLOCK))


def send_test(conn: sa.Connection, tenant: str, webhook: UUID) -> DeliveryRow:
    """Create an event of kind `webhook.test` for one webhook, attempted once.

    Raises:
        NotFound: the tenant has no such webhook.
        Conflict: the webhook is paused.
    """
    _refuse_paused(get_webhook(conn, tenant, webhook))
    event = new_id()
    data = {"webhook": str(webhook)}
    written = sa.insert(webhook_event).values(id=event, tenant_id=tenant, kind=TEST_KIND, data=data, at=CLOCK)
    at = conn.execute(written.returning(webhook_event.c.at)).scalar_one()
    conn.execute(sa.insert(webhook_delivery).values(webhook_id=webhook, event_id=event, next_at=CLOCK, created_at=at))
    return get_delivery(conn, tenant, webhook, event)


def replay_delivery(conn: sa.Connection, tenant: str, webhook: UUID, event: UUID) -> DeliveryRow:
    """Deliver again, from now, with all attempts; a pending delivery becomes due now.

    Raises:
        NotFound: the tenant has no such webhook, or the webhook no such delivery.
        Conflict: the webhook is paused.
    """
    _refuse_paused(get_webhook(conn, tenant, webhook))
    again = {"state": DeliveryState.PENDING, "tries": 0, "next_at": CLOCK, "claim": None, "ended_at": None}
    conn.execute(sa.update(webhook_delivery).where(_is(webhook, event)).values(again))
    return get_delivery(conn, tenant, webhook, event)


def get_delivery(conn: sa.Connection, tenant: str, webhook: UUID, event: UUID) -> DeliveryRow:
    """Return one delivery.

    Raises:
        NotFound: the tenant has no such webhook, or the webhook no such delivery.
    """
    get_webhook(conn, tenant, webhook)
    missing = NotFound(
        "this webhook has no such delivery",
        where=f"delivery {event}",
        hint=f"`marey webhooks deliveries {webhook}` shows those of the last 30 days.",
    )
    return _row(need_row(conn, _deliveries().where(_is(webhook, event)), missing))


def list_deliveries(
    conn: sa.Connection,
    tenant: str,
    webhook: UUID,
    *,
    states: Collection[DeliveryState] = (),
    cursor: str | None = None,
    limit: int = PAGE,
) -> Page[DeliveryRow]:
    """Return deliveries of a webhook, newest event first, optionally in the given states.

    Raises:
        NotFound: the tenant has no such webhook.
    """
    get_webhook(conn, tenant, webhook)
    table = webhook_delivery.c
    ours = table.webhook_id == webhook
    query, order = _deliveries().where(ours), Order(table.created_at, table.event_id)
    if states:
        query = query.where(table.state.in_([str(state) for state in states]))
    return order.page(conn, query, ours, cursor, limit, _row, mark=lambda row: (row.created, row.event))


def delivery_attempts(conn: sa.Connection, webhook: UUID, event: UUID) -> list[AttemptRow]:
    """Return the log of a delivery, in order."""
    c = webhook_attempt.c
    query = sa.select(c.number, c.at, c.status, c.seconds, c.error)
    rows = conn.execute(query.where(c.webhook_id == webhook, c.event_id == event).order_by(c.number))
    return [AttemptRow(*row) for row in rows]


def forget_events(conn: sa.Connection) -> None:
    """Remove expired events, with their deliveries and log."""
    conn.execute(sa.delete(webhook_event).where(webhook_event.c.at < CLOCK - interval(KEPT)))


# --- helpers ---


def _pause_gone(conn: sa.Connection, due: DueDelivery) -> None:
    table = webhook.c
    paused = sa.update(webhook).where(table.id == due.webhook, ~table.paused).values(paused=True)
    tenant = conn.execute(paused.returning(table.tenant_id)).scalar_one_or_none()
    if tenant is not None:
        audit(conn, tenant, DELIVERER, "webhook.gone", due.webhook, event=str(due.event), status=GONE)


def _is(webhook: UUID, event: UUID) -> sa.ColumnElement[bool]:
    return (webhook_delivery.c.webhook_id == webhook) & (webhook_delivery.c.event_id == event)


def _refuse_paused(row: WebhookRow) -> None:
    if row.paused:
        raise Conflict(
            "the webhook is paused, and its deliveries wait",
            where=f"webhook {row.id}",
            hint=f"`marey webhooks resume {row.id}` first.",
        )


def _deliveries() -> sa.Select[*tuple[Any, ...]]:
    c, event, attempt = webhook_delivery.c, webhook_event.c, webhook_attempt.c
    last = (
        sa.select(attempt.status, attempt.error)
        .where(attempt.webhook_id == c.webhook_id, attempt.event_id == c.event_id)
        .order_by(attempt.number.desc())
        .limit(1)
        .lateral("last")
    )
    return (
        sa.select(
            *(c.webhook_id.label("webhook"), c.event_id.label("event"), event.kind, event.data, c.state, c.attempts),
            *(c.next_at.label("next"), c.created_at.label("created"), c.ended_at.label("ended")),
            *(last.c.status, last.c.error),
        )
        .join(webhook_event, event.id == c.event_id)
        .outerjoin(last, sa.true())
    )


def _row(row: sa.RowMapping) -> DeliveryRow:
    values: dict[str, Any] = dict(row)
    values["state"] = DeliveryState(row["state"])
    return DeliveryRow(**values)
