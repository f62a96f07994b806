"""Verdicts of the encoder on the scope of prompts, made in the text stage and kept for later jobs."""

from alembic import op

revision = "0018"
down_revision = "0017"
branch_labels = None
depends_on = None

UP = """
    CREATE TABLE prompt_scope (
        key TEXT NOT NULL,
        text_key TEXT NOT NULL,
        scope JSONB NOT NULL,
        created_at TIMESTAMPTZ DEFAULT now() NOT NULL,
        CONSTRAINT pk_prompt_scope PRIMARY KEY (key)
    );
    CREATE INDEX ix_prompt_scope_text_key ON prompt_scope (text_key);
"""


def upgrade() -> None:
    op.execute(UP)


def downgrade() -> None:
    op.execute("DROP TABLE prompt_scope")
