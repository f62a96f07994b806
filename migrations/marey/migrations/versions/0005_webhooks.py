"""Webhooks: who wants to be told, the outbox, deliveries and their log."""

from alembic import op

revision = "0005"
down_revision = "0004"
branch_labels = None
depends_on = None

WEBHOOK = """
    CREATE TABLE webhook (
        id UUID NOT NULL,
        tenant_id TEXT NOT NULL,
        name TEXT,
        url TEXT NOT NULL,
        events TEXT[] NOT NULL,
        secret BYTEA NOT NULL,
        paused BOOLEAN DEFAULT false NOT NULL,
        created_at TIMESTAMPTZ DEFAULT now() NOT NULL,
        CONSTRAINT pk_webhook PRIMARY KEY (id),
        CONSTRAINT ck_webhook_events CHECK (cardinality(events) > 0),
        CONSTRAINT fk_webhook_tenant_id FOREIGN KEY (tenant_id) REFERENCES tenant (id)
    );
    CREATE INDEX ix_webhook_tenant_id_id ON webhook (tenant_id, id);
"""

EVENT = """
    CREATE TABLE webhook_event (
        id UUID NOT NULL,
        tenant_id TEXT NOT NULL,
        kind TEXT NOT NULL,
        data JSONB NOT NULL,
        at TIMESTAMPTZ NOT NULL,
        CONSTRAINT pk_webhook_event PRIMARY KEY (id),
        CONSTRAINT fk_webhook_event_tenant_id FOREIGN KEY (tenant_id) REFERENCES tenant (id)
    );
    CREATE INDEX ix_webhook_event_at ON webhook_event (at);
"""

DELIVERY = """
    CREATE TABLE webhook_delivery (
        webhook_id UUID NOT NULL,
        event_id UUID NOT NULL,
        state TEXT DEFAULT 'pending' NOT NULL,
        tries INTEGER DEFAULT 0 NOT NULL,
        attempts INTEGER DEFAULT 0 NOT NULL,
        next_at TIMESTAMPTZ,
        claim UUID,
        ended_at TIMESTAMPTZ,
        CONSTRAINT pk_webhook_delivery PRIMARY KEY (webhook_id, event_id),
        CONSTRAINT ck_webhook_delivery_state CHECK (state IN ('pending', 'delivered', 'failed')),
        CONSTRAINT ck_webhook_delivery_next CHECK ((state = 'pending') = (next_at IS NOT NULL)),
        CONSTRAINT ck_webhook_delivery_ended CHECK ((state = 'pending') = (ended_at IS NULL)),
        CONSTRAINT ck_webhook_delivery_claim CHECK (claim IS NULL OR state = 'pending'),
        CONSTRAINT ck_webhook_delivery_tries CHECK (0 <= tries AND tries <= attempts),
        CONSTRAINT fk_webhook_delivery_webhook_id FOREIGN KEY (webhook_id) REFERENCES webhook (id) ON DELETE CASCADE,
        CONSTRAINT fk_webhook_delivery_event_id FOREIGN KEY (event_id) REFERENCES webhook_event (id) ON DELETE CASCADE
    );
    CREATE INDEX ix_webhook_delivery_due ON webhook_delivery (webhook_id, next_at) WHERE state = 'pending';
    CREATE INDEX ix_webhook_delivery_event_id ON webhook_delivery (event_id);
"""

ATTEMPT = """
    CREATE TABLE webhook_attempt (
        webhook_id UUID NOT NULL,
        event_id UUID NOT NULL,
        number INTEGER NOT NULL,
        at TIMESTAMPTZ NOT NULL,
        status INTEGER,
        seconds DOUBLE PRECISION NOT NULL,
        error TEXT,
        CONSTRAINT pk_webhook_attempt PRIMARY KEY (webhook_id, event_id, number),
        CONSTRAINT fk_webhook_attempt_delivery FOREIGN KEY (webhook_id, event_id)
            REFERENCES webhook_delivery (webhook_id, event_id) ON DELETE CASCADE
    );
"""


def upgrade() -> None:
    for statement in (WEBHOOK, EVENT, DELIVERY, ATTEMPT):
        op.execute(statement)


def downgrade() -> None:
    for table in ("webhook_attempt", "webhook_delivery", "webhook_event", "webhook"):
        op.execute(f"DROP TABLE {table}")
