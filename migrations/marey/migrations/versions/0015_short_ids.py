"""Ids that a person can type: the last eight digits of an id, and names, found by index."""

from alembic import op

revision = "0015"
down_revision = "0014"
branch_labels = None
depends_on = None

SHORT = ("job", "evaluation", "schedule", "stream", "webhook", "api_key")
NAMED = ("job", "evaluation", "stream")


def upgrade() -> None:
    for table in SHORT:
        op.execute(f"CREATE INDEX IF NOT EXISTS ix_{table}_short_id ON {table} (tenant_id, right(id::text, 8))")
    op.execute(
        "CREATE INDEX IF NOT EXISTS ix_webhook_delivery_short_id"
        " ON webhook_delivery (webhook_id, right(event_id::text, 8))"
    )
    op.execute(
        "CREATE INDEX IF NOT EXISTS ix_motion_search_short_id ON motion_search (tenant_id, right(motion_id::text, 8))"
    )
    for table in NAMED:
        op.execute(f"CREATE INDEX IF NOT EXISTS ix_{table}_name ON {table} (tenant_id, name) WHERE name IS NOT NULL")


def downgrade() -> None:
    for table in (*SHORT, "webhook_delivery", "motion_search"):
        op.execute(f"DROP INDEX ix_{table}_short_id")
    for table in NAMED:
        op.execute(f"DROP INDEX ix_{table}_name")
