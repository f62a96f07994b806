"""How prompts of a stream were rewritten, for its viewers."""

from alembic import op

revision = "0012"
down_revision = "0011"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.execute("ALTER TABLE stream_chunk ADD COLUMN reads JSONB")


def downgrade() -> None:
    op.execute("ALTER TABLE stream_chunk DROP COLUMN reads")
