"""Files of motions that the API made on request, and those that it is making.

A trigger removes them when the motion's prompt is erased: also when an API process of an earlier release erases it.
"""

from alembic import op

revision = "0019"
down_revision = "0018"
branch_labels = None
depends_on = None

UP = """
    CREATE TABLE made_file (
        motion_id UUID NOT NULL,
        key TEXT NOT NULL,
        tenant_id TEXT NOT NULL,
        format TEXT NOT NULL,
        asset_id UUID,
        size BIGINT DEFAULT 0 NOT NULL,
        claim UUID,
        problem JSONB,
        expires_at TIMESTAMPTZ,
        made_at TIMESTAMPTZ DEFAULT now() NOT NULL,
        CONSTRAINT pk_made_file PRIMARY KEY (motion_id, key),
        CONSTRAINT fk_made_file_motion_id FOREIGN KEY (motion_id) REFERENCES motion (id) ON DELETE CASCADE,
        CONSTRAINT fk_made_file_tenant_id FOREIGN KEY (tenant_id) REFERENCES tenant (id),
        CONSTRAINT fk_made_file_asset_id FOREIGN KEY (asset_id) REFERENCES asset (id) ON DELETE CASCADE,
        CONSTRAINT ck_made_file_state CHECK (num_nonnulls(asset_id, claim, problem) = 1),
        CONSTRAINT ck_made_file_expires CHECK ((expires_at IS NULL) = (asset_id IS NOT NULL))
    );
    CREATE INDEX ix_made_file_asset_id ON made_file (asset_id) WHERE asset_id IS NOT NULL;
    CREATE INDEX ix_made_file_tenant_id ON made_file (tenant_id, made_at) INCLUDE (size) WHERE asset_id IS NOT NULL;
    CREATE INDEX ix_made_file_expires_at ON made_file (expires_at) WHERE expires_at IS NOT NULL;

    CREATE FUNCTION made_file_erase() RETURNS trigger LANGUAGE plpgsql AS $$
    BEGIN
        DELETE FROM made_file WHERE motion_id = NEW.motion_id;
        RETURN NULL;
    END $$;
    CREATE TRIGGER made_file_erase AFTER UPDATE OF erasing ON motion_file FOR EACH ROW
        WHEN (NEW.erasing AND NOT OLD.erasing)
        EXECUTE FUNCTION made_file_erase();
"""

DOWN = """
    DROP TRIGGER made_file_erase ON motion_file;
    DROP FUNCTION made_file_erase;
    DROP TABLE made_file;
"""


def upgrade() -> None:
    op.execute(UP)


def downgrade() -> None:
    op.execute(DOWN)
