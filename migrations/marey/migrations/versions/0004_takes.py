"""Takes: what motions are searched by, what was thought of them, re-rolls, retention and erasure."""

from alembic import op

revision = "0004"
down_revision = "0003"
branch_labels = None
depends_on = None

UP = """
    ALTER TABLE job
        ADD COLUMN keep_days INTEGER,
        ADD COLUMN erased_at TIMESTAMPTZ,
        ADD CONSTRAINT ck_job_keep_days CHECK (keep_days BETWEEN 1 AND 36500);
    CREATE INDEX ix_job_keep_days ON job (id) WHERE keep_days IS NOT NULL;

    ALTER TABLE item
        ADD COLUMN replaces UUID,
        ADD CONSTRAINT fk_item_replaces FOREIGN KEY (replaces) REFERENCES motion (id) ON DELETE SET NULL;
    CREATE UNIQUE INDEX ix_item_replaces ON item (replaces) WHERE replaces IS NOT NULL;
    CREATE INDEX ix_item_tags ON item USING gin (tags) WHERE state = 'succeeded' AND tags <> '{}';
    CREATE INDEX ix_item_name ON item (lower(name) text_pattern_ops) WHERE state = 'succeeded' AND name IS NOT NULL;
    CREATE INDEX ix_item_words ON item USING gin (to_tsvector('english'::regconfig, prompt)) WHERE state = 'succeeded';

    ALTER TABLE motion
        ADD COLUMN review TEXT,
        ADD COLUMN reviewed_at TIMESTAMPTZ,
        ADD COLUMN reviewed_by TEXT,
        ADD COLUMN review_comment TEXT,
        ADD CONSTRAINT ck_motion_review CHECK (review IN ('kept', 'rejected', 'rerolled')),
        ADD CONSTRAINT ck_motion_reviewed CHECK (num_nulls(review, reviewed_at, reviewed_by) IN (0, 3)),
        ADD CONSTRAINT ck_motion_review_comment CHECK (review IS NOT NULL OR review_comment IS NULL);
    CREATE INDEX ix_motion_review ON motion (tenant_id, review, id) WHERE review IS NOT NULL;

    ALTER TABLE motion_file ADD COLUMN erasing BOOLEAN DEFAULT false NOT NULL;
    CREATE INDEX ix_motion_file_erasing ON motion_file (motion_id) WHERE erasing;
"""

DOWN = """
    ALTER TABLE motion_file DROP COLUMN erasing;
    ALTER TABLE motion
        DROP COLUMN review, DROP COLUMN reviewed_at, DROP COLUMN reviewed_by, DROP COLUMN review_comment;
    DROP INDEX ix_item_tags, ix_item_name, ix_item_words;
    ALTER TABLE item DROP COLUMN replaces;
    ALTER TABLE job DROP COLUMN keep_days, DROP COLUMN erased_at;
"""


def upgrade() -> None:
    op.execute(UP)


def downgrade() -> None:
    op.execute(DOWN)
