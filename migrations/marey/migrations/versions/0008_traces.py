"""Traces: a job knows the request that submitted it."""

from alembic import op

revision = "0008"
down_revision = "0007"
branch_labels = None
depends_on = None

UP = """
    ALTER TABLE job
        ADD COLUMN traceparent TEXT,
        ADD CONSTRAINT ck_job_traceparent CHECK (traceparent ~ '^00-[0-9a-f]{32}-[0-9a-f]{16}-[0-9a-f]{2}$');
"""


def upgrade() -> None:
    op.execute(UP)


def downgrade() -> None:
    op.execute("ALTER TABLE job DROP COLUMN traceparent")
