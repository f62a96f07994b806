"""Tables of webhooks: subscriptions, the outbox of events, deliveries and attempts.

A transaction that writes an event holds the lock of the event's row, and takes webhook rows (KEY SHARE) after it; no
transaction locks them in the opposite order.
"""

from __future__ import annotations

import sqlalchemy as sa
from sqlalchemy.dialects.postgresql import ARRAY, BYTEA, JSONB

from marey.db.tables import NOW, Id, Time, metadata, short_id

webhook = sa.Table(
    "webhook",
    metadata,
    sa.Column("id", Id, primary_key=True),
    sa.Column("tenant_id", sa.Text, sa.ForeignKey("tenant.id"), nullable=False),
    sa.Column("name", sa.Text),
    sa.Column("url", sa.Text, nullable=False),
    sa.Column("events", ARRAY(sa.Text), nullable=False),
    sa.Column("secret", BYTEA, nullable=False),  # encrypted: `marey.webhooks.vault`
    sa.Column("previous_secret", BYTEA),  # also signs until then
    sa.Column("previous_until", Time),
    sa.Column("paused", sa.Boolean, nullable=False, server_default=sa.false()),
    sa.Column("created_at", Time, nullable=False, server_default=NOW),
    sa.CheckConstraint("cardinality(events) > 0", name="events"),
    sa.CheckConstraint("(previous_secret IS NULL) = (previous_until IS NULL)", name="previous"),
    sa.Index("ix_webhook_tenant_id_id", "tenant_id", "id"),
    sa.Index("ix_webhook_created", "tenant_id", "created_at", "id"),
    sa.Index("ix_webhook_short_id", "tenant_id", short_id()),
)

# One row per event, independent of the number of webhooks; none without a subscriber.
webhook_event = sa.Table(
    "webhook_event",
    metadata,
    sa.Column("id", Id, primary_key=True),  # message id for receivers, the same in every attempt
    sa.Column("tenant_id", sa.Text, sa.ForeignKey("tenant.id"), nullable=False),
    sa.Column("kind", sa.Text, nullable=False),
    sa.Column("data", JSONB, nullable=False),
    sa.Column("at", Time, nullable=False),
    sa.Index("ix_webhook_event_at", "at"),
)

webhook_delivery = sa.Table(
    "webhook_delivery",
    metadata,
    sa.Column("webhook_id", Id, sa.ForeignKey("webhook.id", ondelete="CASCADE"), primary_key=True),
    sa.Column("event_id", Id, sa.ForeignKey("webhook_event.id", ondelete="CASCADE"), primary_key=True),
    sa.Column("state", sa.Text, nullable=False, server_default="pending"),
    sa.Column("tries", sa.Integer, nullable=False, server_default="0"),  # attempts since it was written, or replayed
    sa.Column("attempts", sa.Integer, nullable=False, server_default="0"),  # attempts in total
    sa.Column("next_at", Time),  # time of the next attempt; while claimed, when the claim expires
    sa.Column("claim", Id),  # fences the record of an attempt
    sa.Column("ended_at", Time),
    sa.Column("created_at", Time, nullable=False, server_default=NOW),
    sa.CheckConstraint("state IN ('pending', 'delivered', 'failed')", name="state"),
    sa.CheckConstraint("(state = 'pending') = (next_at IS NOT NULL)", name="next"),
    sa.CheckConstraint("(state = 'pending') = (ended_at IS NULL)", name="ended"),
    sa.CheckConstraint("claim IS NULL OR state = 'pending'", name="claim"),
    sa.CheckConstraint("0 <= tries AND tries <= attempts", name="tries"),
    sa.Index("ix_webhook_delivery_due", "webhook_id", "next_at", postgresql_where=sa.text("state = 'pending'")),
    sa.Index("ix_webhook_delivery_event_id", "event_id"),
    sa.Index("ix_webhook_delivery_created", "webhook_id", "created_at", "event_id"),
    sa.Index("ix_webhook_delivery_short_id", "webhook_id", short_id("event_id")),
)

webhook_attempt = sa.Table(
    "webhook_attempt",
    metadata,
    sa.Column("webhook_id", Id, primary_key=True),
    sa.Column("event_id", Id, primary_key=True),
    sa.Column("number", sa.Integer, primary_key=True, autoincrement=False),
    sa.Column("at", Time, nullable=False),  # end of the attempt
    sa.Column("status", sa.Integer),  # status of the answer; null = there was none
    sa.Column("seconds", sa.Double, nullable=False),
    sa.Column("error", sa.Text),  # null = delivered
    sa.ForeignKeyConstraint(
        ["webhook_id", "event_id"],
        ["webhook_delivery.webhook_id", "webhook_delivery.event_id"],
        name="fk_webhook_attempt_delivery",
        ondelete="CASCADE",
    ),
)
