"""Edits of stored motions: the kind of a job, the operations of an item, and the motions that it was made from.

`edited_from` holds the sources of sources too, so that erasure finds every motion made from a prompt when one between
them was deleted.
"""

from alembic import op

revision = "0020"
down_revision = "0019"
branch_labels = None
depends_on = None

UP = """
    ALTER TABLE job
        ADD COLUMN kind TEXT NOT NULL DEFAULT 'generate',
        ADD CONSTRAINT ck_job_kind CHECK (kind IN ('generate', 'edit'));
    ALTER TABLE item ADD COLUMN edits JSONB;
    CREATE TABLE edited_from (
        item_id UUID NOT NULL,
        source_id UUID NOT NULL,
        CONSTRAINT pk_edited_from PRIMARY KEY (item_id, source_id),
        CONSTRAINT fk_edited_from_item_id FOREIGN KEY (item_id) REFERENCES item (id) ON DELETE CASCADE
    );
    CREATE INDEX ix_edited_from_source_id ON edited_from (source_id);
"""

DOWN = """
    DROP TABLE edited_from;
    ALTER TABLE item DROP COLUMN edits;
    ALTER TABLE job DROP COLUMN kind;
"""


def upgrade() -> None:
    op.execute(UP)


def downgrade() -> None:
    op.execute(DOWN)
