"""Idempotency keys of evaluations."""

from alembic import op

revision = "0007"
down_revision = "0006"
branch_labels = None
depends_on = None

UP = """
    ALTER TABLE idempotency
        ALTER COLUMN job_id DROP NOT NULL,
        ADD COLUMN evaluation_id UUID,
        ADD CONSTRAINT fk_idempotency_evaluation_id FOREIGN KEY (evaluation_id) REFERENCES evaluation (id)
            ON DELETE CASCADE DEFERRABLE INITIALLY DEFERRED,
        ADD CONSTRAINT ck_idempotency_made CHECK (num_nonnulls(job_id, evaluation_id) = 1);
    CREATE INDEX ix_idempotency_evaluation_id ON idempotency (evaluation_id);
"""

DOWN = """
    DELETE FROM idempotency WHERE job_id IS NULL;
    ALTER TABLE idempotency
        DROP CONSTRAINT ck_idempotency_made,
        DROP COLUMN evaluation_id,
        ALTER COLUMN job_id SET NOT NULL;
"""


def upgrade() -> None:
    op.execute(UP)


def downgrade() -> None:
    op.execute(DOWN)
