"""Starts of the actions of a stream, so that a worker that resumes it knows the current one."""

from alembic import op

revision = "0011"
down_revision = "0009"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.execute("ALTER TABLE stream_chunk ADD COLUMN acts JSONB")


def downgrade() -> None:
    op.execute("ALTER TABLE stream_chunk DROP COLUMN acts")
