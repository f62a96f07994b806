"""Tenants: quotas, suspension; keys that expire and are rotated; an audit log."""

from alembic import op

revision = "0006"
down_revision = "0005"
branch_labels = None
depends_on = None

TENANT = """
    ALTER TABLE tenant
        ADD COLUMN suspended_at TIMESTAMPTZ,
        ADD COLUMN max_queued INTEGER,
        ADD COLUMN max_running INTEGER,
        ADD COLUMN max_bytes BIGINT,
        ADD COLUMN max_streams INTEGER,
        ADD CONSTRAINT ck_tenant_id CHECK (id ~ '^[a-z0-9][a-z0-9_-]{0,62}$'),
        ADD CONSTRAINT ck_tenant_quotas CHECK (least(max_queued, max_running, max_bytes, max_streams) >= 0);
"""

API_KEY = """
    ALTER TABLE api_key
        ADD COLUMN expires_at TIMESTAMPTZ,
        ADD COLUMN replaced_by UUID,
        ADD COLUMN rates JSONB DEFAULT '{}' NOT NULL,
        ADD CONSTRAINT fk_api_key_replaced_by FOREIGN KEY (replaced_by) REFERENCES api_key (id);
    CREATE INDEX ix_api_key_tenant_id_id ON api_key (tenant_id, id);
"""

USAGE = """
    CREATE INDEX ix_job_open ON job (tenant_id) WHERE finished_at IS NULL;
    CREATE INDEX ix_asset_stored ON asset (tenant_id) INCLUDE (size) WHERE state = 'stored';
"""

AUDIT = """
    CREATE TABLE audit_event (
        id UUID NOT NULL,
        at TIMESTAMPTZ NOT NULL,
        tenant_id TEXT NOT NULL,
        key_id UUID,
        actor TEXT NOT NULL,
        verb TEXT NOT NULL,
        target TEXT NOT NULL,
        data JSONB NOT NULL,
        CONSTRAINT pk_audit_event PRIMARY KEY (id)
    );
    CREATE INDEX ix_audit_event_tenant_id_id ON audit_event (tenant_id, id);
    CREATE INDEX ix_audit_event_at ON audit_event (at);
"""


def upgrade() -> None:
    for statement in (TENANT, API_KEY, USAGE, AUDIT):
        op.execute(statement)


def downgrade() -> None:
    op.execute("DROP TABLE audit_event")
    op.execute("DROP INDEX ix_asset_stored")
    op.execute("DROP INDEX ix_job_open")
    op.execute("DROP INDEX ix_api_key_tenant_id_id")
    op.execute("ALTER TABLE api_key DROP COLUMN expires_at, DROP COLUMN replaced_by, DROP COLUMN rates")
    op.execute(
        "ALTER TABLE tenant DROP CONSTRAINT ck_tenant_id, DROP CONSTRAINT ck_tenant_quotas, DROP COLUMN suspended_at,"
        " DROP COLUMN max_queued, DROP COLUMN max_running, DROP COLUMN max_bytes, DROP COLUMN max_streams"
    )
