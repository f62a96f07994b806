"""Listings in the order of the database's clock: an index of creation time and id for each of them."""

from alembic import op

revision = "0013"
down_revision = "0012"
branch_labels = None
depends_on = None

INDEXES = {
    "ix_job_created": "job (tenant_id, created_at, id)",
    "ix_evaluation_created": "evaluation (tenant_id, created_at, id)",
    "ix_evaluation_schedule_created": "evaluation (schedule_id, created_at, id)",
    "ix_schedule_created": "schedule (tenant_id, created_at, id)",
    "ix_stream_created": "stream (tenant_id, created_at, id)",
    "ix_webhook_created": "webhook (tenant_id, created_at, id)",
    "ix_webhook_delivery_created": "webhook_delivery (webhook_id, created_at, event_id)",
    "ix_audit_event_created": "audit_event (tenant_id, at, id)",
    "ix_audit_event_at_id": "audit_event (at, id)",
}

# A scheduler of an earlier release writes deliveries without it.
DELIVERY = """
    ALTER TABLE webhook_delivery ADD COLUMN created_at TIMESTAMPTZ DEFAULT now() NOT NULL;
    UPDATE webhook_delivery SET created_at = event.at FROM webhook_event AS event WHERE event.id = event_id;
"""


def upgrade() -> None:
    op.execute(DELIVERY)
    for name, columns in INDEXES.items():
        op.execute(f"CREATE INDEX IF NOT EXISTS {name} ON {columns}")


def downgrade() -> None:
    for name in INDEXES:
        op.execute(f"DROP INDEX {name}")
    op.execute("ALTER TABLE webhook_delivery DROP COLUMN created_at")
