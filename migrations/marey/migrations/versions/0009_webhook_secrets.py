"""Two signing secrets of a webhook at a time, while it is rotated."""

from alembic import op

revision = "0009"
down_revision = "0008"
branch_labels = None
depends_on = None

UP = """
    ALTER TABLE webhook
        ADD COLUMN previous_secret BYTEA,
        ADD COLUMN previous_until TIMESTAMPTZ,
        ADD CONSTRAINT ck_webhook_previous CHECK ((previous_secret IS NULL) = (previous_until IS NULL));
"""

DOWN = """
    ALTER TABLE webhook
        DROP CONSTRAINT ck_webhook_previous,
        DROP COLUMN previous_until,
        DROP COLUMN previous_secret;
"""


def upgrade() -> None:
    op.execute(UP)


def downgrade() -> None:
    op.execute(DOWN)
