"""Timelines of prompts and constraints of motions; null = the prompt alone."""

from alembic import op

revision = "0022"
down_revision = "0021"
branch_labels = None
depends_on = None

UP = "ALTER TABLE item ADD COLUMN timeline JSONB, ADD COLUMN constraints JSONB"
DOWN = "ALTER TABLE item DROP COLUMN timeline, DROP COLUMN constraints"


def upgrade() -> None:
    op.execute(UP)


def downgrade() -> None:
    op.execute(DOWN)
