"""Rigs of a tenant: the file of a character under a name, its map of joints, and what is found in it.

Files made on a rig name it, so that they go with it.
"""

from alembic import op

revision = "0021"
down_revision = "0020"
branch_labels = None
depends_on = None

UP = """
    CREATE TABLE rig (
        id UUID NOT NULL,
        tenant_id TEXT NOT NULL,
        name TEXT NOT NULL,
        version INTEGER DEFAULT 1 NOT NULL,
        format TEXT NOT NULL,
        asset_id UUID NOT NULL,
        map JSONB,
        report JSONB NOT NULL,
        added_by TEXT NOT NULL,
        created_at TIMESTAMPTZ DEFAULT now() NOT NULL,
        updated_at TIMESTAMPTZ DEFAULT now() NOT NULL,
        CONSTRAINT pk_rig PRIMARY KEY (id),
        CONSTRAINT uq_rig_tenant_id_name UNIQUE (tenant_id, name),
        CONSTRAINT fk_rig_tenant_id FOREIGN KEY (tenant_id) REFERENCES tenant (id),
        CONSTRAINT fk_rig_asset_id FOREIGN KEY (asset_id) REFERENCES asset (id)
    );
    CREATE INDEX ix_rig_asset_id ON rig (asset_id);
    ALTER TABLE made_file
        ADD COLUMN rig_id UUID,
        ADD CONSTRAINT fk_made_file_rig_id FOREIGN KEY (rig_id) REFERENCES rig (id) ON DELETE CASCADE;
    CREATE INDEX ix_made_file_rig_id ON made_file (rig_id) WHERE rig_id IS NOT NULL;
"""

DOWN = """
    ALTER TABLE made_file DROP COLUMN rig_id;
    DROP TABLE rig;
"""


def upgrade() -> None:
    op.execute(UP)


def downgrade() -> None:
    op.execute(DOWN)
