"""Tables of tenants, their keys, and the audit log."""

from __future__ import annotations

import sqlalchemy as sa
from sqlalchemy.dialects.postgresql import ARRAY, BYTEA, JSONB

from marey.db.tables import NOW, Id, Time, metadata, short_id

tenant = sa.Table(
    "tenant",
    metadata,
    sa.Column("id", sa.Text, primary_key=True),
    sa.Column("created_at", Time, nullable=False, server_default=NOW),
    sa.Column("suspended_at", Time),  # set = requests are refused, items are not claimed
    # Quotas; null = none. Their use is computed from the items and files: a separate counter could drift.
    sa.Column("max_queued", sa.Integer),
    sa.Column("max_running", sa.Integer),
    sa.Column("max_bytes", sa.BigInteger),
    sa.Column("max_streams", sa.Integer),  # open ones of one key; null = MAREY_STREAMS_PER_KEY
    sa.CheckConstraint("id ~ '^[a-z0-9][a-z0-9_-]{0,62}$'", name="id"),  # part of the keys of the asset store
    sa.CheckConstraint("least(max_queued, max_running, max_bytes, max_streams) >= 0", name="quotas"),
)

api_key = sa.Table(
    "api_key",
    metadata,
    sa.Column("id", Id, primary_key=True),
    sa.Column("tenant_id", sa.Text, sa.ForeignKey("tenant.id"), nullable=False),
    sa.Column("name", sa.Text, nullable=False),
    sa.Column("prefix", sa.Text, nullable=False, unique=True),
    sa.Column("secret_sha256", BYTEA, nullable=False),
    sa.Column("scopes", ARRAY(sa.Text), nullable=False),
    sa.Column("created_at", Time, nullable=False, server_default=NOW),
    sa.Column("last_used_at", Time),  # precise to a minute
    sa.Column("expires_at", Time),
    sa.Column("revoked_at", Time),
    sa.Column("replaced_by", Id, sa.ForeignKey("api_key.id")),  # the key it was rotated to
    sa.Column("rates", JSONB, nullable=False, server_default=sa.text("'{}'")),  # {"submit": "60/minute"}
    sa.Index("ix_api_key_tenant_id_id", "tenant_id", "id"),
    sa.Index("ix_api_key_short_id", "tenant_id", short_id()),
)

# The audit log. Without foreign keys: it outlives its subjects.
audit_event = sa.Table(
    "audit_event",
    metadata,
    sa.Column("id", Id, primary_key=True),
    sa.Column("at", Time, nullable=False),
    sa.Column("tenant_id", sa.Text, nullable=False),
    sa.Column("key_id", Id),  # null = an operator at the database (`marey admin`)
    sa.Column("actor", sa.Text, nullable=False),  # name of the key, or of the user who ran the command
    sa.Column("verb", sa.Text, nullable=False),
    sa.Column("target", sa.Text, nullable=False),
    sa.Column("data", JSONB, nullable=False),  # no prompts, no secrets
    sa.Index("ix_audit_event_tenant_id_id", "tenant_id", "id"),
    sa.Index("ix_audit_event_created", "tenant_id", "at", "id"),
    sa.Index("ix_audit_event_at", "at"),
    sa.Index("ix_audit_event_at_id", "at", "id"),
)
