"""Scopes: a job's treatment of prompts that its model does not know, and the scope of each prompt."""

from alembic import op

revision = "0016"
down_revision = "0015"
branch_labels = None
depends_on = None

UP = """
    ALTER TABLE job
        ADD COLUMN scope TEXT NOT NULL DEFAULT 'ignore',
        ADD CONSTRAINT ck_job_scope CHECK (scope IN ('warn', 'refuse', 'ignore'));
    ALTER TABLE item ADD COLUMN scope JSONB;
"""


def upgrade() -> None:
    op.execute(UP)


def downgrade() -> None:
    op.execute("ALTER TABLE job DROP COLUMN scope; ALTER TABLE item DROP COLUMN scope;")
