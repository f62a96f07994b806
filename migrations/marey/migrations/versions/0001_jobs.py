"""Jobs, items, leases, assets and motions."""

from alembic import op

revision = "0001"
down_revision = None
branch_labels = None
depends_on = None

TABLES = (
    """
    CREATE TABLE tenant (
        id TEXT NOT NULL,
        created_at TIMESTAMPTZ DEFAULT now() NOT NULL,
        CONSTRAINT pk_tenant PRIMARY KEY (id)
    );
    """,
    """
    CREATE TABLE text_features (
        key TEXT NOT NULL,
        blob BYTEA NOT NULL,
        created_at TIMESTAMPTZ DEFAULT now() NOT NULL,
        CONSTRAINT pk_text_features PRIMARY KEY (key)
    );
    """,
    """
    CREATE TABLE worker (
        id TEXT NOT NULL,
        queue TEXT NOT NULL,
        host TEXT NOT NULL,
        pid INTEGER NOT NULL,
        device TEXT NOT NULL,
        bundle TEXT,
        batch_key TEXT,
        started_at TIMESTAMPTZ NOT NULL,
        seen_at TIMESTAMPTZ NOT NULL,
        CONSTRAINT pk_worker PRIMARY KEY (id)
    );
    """,
    """
    CREATE TABLE api_key (
        id UUID NOT NULL,
        tenant_id TEXT NOT NULL,
        name TEXT NOT NULL,
        prefix TEXT NOT NULL,
        secret_sha256 BYTEA NOT NULL,
        scopes TEXT[] NOT NULL,
        created_at TIMESTAMPTZ DEFAULT now() NOT NULL,
        last_used_at TIMESTAMPTZ,
        revoked_at TIMESTAMPTZ,
        CONSTRAINT pk_api_key PRIMARY KEY (id),
        CONSTRAINT fk_api_key_tenant_id FOREIGN KEY (tenant_id) REFERENCES tenant (id),
        CONSTRAINT uq_api_key_prefix UNIQUE (prefix)
    );
    """,
    """
    CREATE TABLE asset (
        id UUID NOT NULL,
        tenant_id TEXT NOT NULL,
        sha256 TEXT NOT NULL,
        size BIGINT NOT NULL,
        media_type TEXT NOT NULL,
        state TEXT NOT NULL,
        created_at TIMESTAMPTZ DEFAULT now() NOT NULL,
        announced_at TIMESTAMPTZ NOT NULL,
        CONSTRAINT pk_asset PRIMARY KEY (id),
        CONSTRAINT uq_asset_tenant_id_sha256 UNIQUE (tenant_id, sha256),
        CONSTRAINT ck_asset_state CHECK (state IN ('writing', 'stored')),
        CONSTRAINT ck_asset_sha256 CHECK (sha256 ~ '^[0-9a-f]{64}$'),
        CONSTRAINT fk_asset_tenant_id FOREIGN KEY (tenant_id) REFERENCES tenant (id)
    );
    CREATE INDEX ix_asset_writing ON asset (announced_at) WHERE state = 'writing';
    """,
    """
    CREATE TABLE job (
        id UUID NOT NULL,
        tenant_id TEXT NOT NULL,
        name TEXT,
        comment TEXT,
        priority INTEGER DEFAULT 0 NOT NULL,
        control TEXT DEFAULT 'run' NOT NULL,
        fail_early DOUBLE PRECISION,
        total INTEGER DEFAULT 0 NOT NULL,
        ready INTEGER DEFAULT 0 NOT NULL,
        leased INTEGER DEFAULT 0 NOT NULL,
        succeeded INTEGER DEFAULT 0 NOT NULL,
        failed INTEGER DEFAULT 0 NOT NULL,
        dead INTEGER DEFAULT 0 NOT NULL,
        cancelled INTEGER DEFAULT 0 NOT NULL,
        state TEXT GENERATED ALWAYS AS (
            CASE
                WHEN ready + leased > 0 THEN
                    CASE WHEN control = 'paused' THEN 'paused' WHEN started_at IS NULL THEN 'queued' ELSE 'running' END
                WHEN total = 0 THEN 'queued'
                WHEN succeeded = total THEN 'succeeded'
                WHEN control = 'cancelled' THEN 'cancelled'
                WHEN succeeded > 0 THEN 'partial'
                ELSE 'failed'
            END
        ) STORED NOT NULL,
        event_seq BIGINT DEFAULT 0 NOT NULL,
        created_at TIMESTAMPTZ DEFAULT now() NOT NULL,
        started_at TIMESTAMPTZ,
        finished_at TIMESTAMPTZ,
        CONSTRAINT pk_job PRIMARY KEY (id),
        CONSTRAINT ck_job_control CHECK (control IN ('run', 'paused', 'cancelled')),
        CONSTRAINT ck_job_priority CHECK (priority BETWEEN -1000 AND 1000),
        CONSTRAINT ck_job_fail_early CHECK (fail_early BETWEEN 0 AND 1),
        CONSTRAINT ck_job_counters CHECK (
            least(ready, leased, succeeded, failed, dead, cancelled) >= 0
            AND ready + leased + succeeded + failed + dead + cancelled = total
        ),
        CONSTRAINT fk_job_tenant_id FOREIGN KEY (tenant_id) REFERENCES tenant (id)
    ) WITH (fillfactor = 50);
    CREATE INDEX ix_job_tenant_id_id ON job (tenant_id, id);
    """,
    """
    CREATE TABLE idempotency (
        tenant_id TEXT NOT NULL,
        key TEXT NOT NULL,
        body_sha256 TEXT NOT NULL,
        job_id UUID NOT NULL,
        created_at TIMESTAMPTZ NOT NULL,
        CONSTRAINT pk_idempotency PRIMARY KEY (tenant_id, key),
        CONSTRAINT fk_idempotency_tenant_id FOREIGN KEY (tenant_id) REFERENCES tenant (id),
        CONSTRAINT fk_idempotency_job_id FOREIGN KEY (job_id) REFERENCES job (id)
            ON DELETE CASCADE DEFERRABLE INITIALLY DEFERRED
    );
    CREATE INDEX ix_idempotency_created_at ON idempotency (created_at);
    CREATE INDEX ix_idempotency_job_id ON idempotency (job_id);
    """,
    """
    CREATE TABLE job_event (
        job_id UUID NOT NULL,
        seq BIGINT NOT NULL,
        kind TEXT NOT NULL,
        item_id UUID,
        reason TEXT NOT NULL,
        data JSONB NOT NULL,
        at TIMESTAMPTZ NOT NULL,
        CONSTRAINT pk_job_event PRIMARY KEY (job_id, seq),
        CONSTRAINT fk_job_event_job_id FOREIGN KEY (job_id) REFERENCES job (id) ON DELETE CASCADE
    );
    """,
    """
    CREATE TABLE lane (
        job_id UUID NOT NULL,
        queue TEXT NOT NULL,
        batch_key TEXT NOT NULL,
        ready INTEGER NOT NULL,
        solo INTEGER NOT NULL,
        waiting_since TIMESTAMPTZ DEFAULT now() NOT NULL,
        CONSTRAINT pk_lane PRIMARY KEY (job_id, queue, batch_key),
        CONSTRAINT ck_lane_counters CHECK (ready >= 0 AND solo >= 0),
        CONSTRAINT fk_lane_job_id FOREIGN KEY (job_id) REFERENCES job (id) ON DELETE CASCADE
    ) WITH (fillfactor = 50);
    CREATE INDEX ix_lane_queue ON lane (queue);
    """,
    """
    CREATE TABLE lease (
        token UUID NOT NULL,
        job_id UUID NOT NULL,
        queue TEXT NOT NULL,
        worker TEXT NOT NULL,
        solo BOOLEAN NOT NULL,
        claimed_at TIMESTAMPTZ NOT NULL,
        progress_at TIMESTAMPTZ NOT NULL,
        expires_at TIMESTAMPTZ NOT NULL,
        CONSTRAINT pk_lease PRIMARY KEY (token),
        CONSTRAINT fk_lease_job_id FOREIGN KEY (job_id) REFERENCES job (id) ON DELETE CASCADE
    );
    CREATE INDEX ix_lease_expires_at ON lease (expires_at);
    CREATE INDEX ix_lease_job_id ON lease (job_id);
    """,
    """
    CREATE TABLE asset_writer (
        asset_id UUID NOT NULL,
        lease_token UUID NOT NULL,
        CONSTRAINT pk_asset_writer PRIMARY KEY (asset_id, lease_token),
        CONSTRAINT fk_asset_writer_asset_id FOREIGN KEY (asset_id) REFERENCES asset (id) ON DELETE CASCADE,
        CONSTRAINT fk_asset_writer_lease_token FOREIGN KEY (lease_token) REFERENCES lease (token) ON DELETE CASCADE
    );
    CREATE INDEX ix_asset_writer_lease_token ON asset_writer (lease_token);
    """,
    """
    CREATE TABLE item (
        id UUID NOT NULL,
        job_id UUID NOT NULL,
        position INTEGER NOT NULL,
        index INTEGER NOT NULL,
        variant INTEGER NOT NULL,
        name TEXT,
        prompt TEXT NOT NULL,
        model TEXT NOT NULL,
        bundle TEXT NOT NULL,
        seed INTEGER NOT NULL,
        seconds DOUBLE PRECISION,
        settings JSONB NOT NULL,
        tags TEXT[] NOT NULL,
        text_key TEXT NOT NULL,
        generate_batch_key TEXT NOT NULL,
        stage TEXT NOT NULL,
        queue TEXT NOT NULL,
        batch_key TEXT NOT NULL,
        state TEXT DEFAULT 'ready' NOT NULL,
        reason TEXT,
        attempts INTEGER DEFAULT 0 NOT NULL,
        solo BOOLEAN DEFAULT false NOT NULL,
        run_after TIMESTAMPTZ,
        lease_token UUID,
        problem JSONB,
        created_at TIMESTAMPTZ DEFAULT now() NOT NULL,
        finished_at TIMESTAMPTZ,
        CONSTRAINT pk_item PRIMARY KEY (id),
        CONSTRAINT ck_item_state CHECK (state IN ('ready', 'leased', 'succeeded', 'failed', 'dead', 'cancelled')),
        CONSTRAINT ck_item_stage CHECK (stage IN ('text', 'generate')),
        CONSTRAINT ck_item_lease CHECK ((state = 'leased') = (lease_token IS NOT NULL)),
        CONSTRAINT ck_item_run_after CHECK (run_after IS NULL OR state = 'ready'),
        CONSTRAINT ck_item_finished CHECK ((finished_at IS NULL) = (state IN ('ready', 'leased'))),
        CONSTRAINT ck_item_succeeded CHECK (state <> 'succeeded' OR stage = 'generate'),
        CONSTRAINT ck_item_seed CHECK (seed >= 0),
        CONSTRAINT uq_item_job_id_position UNIQUE (job_id, position),
        CONSTRAINT fk_item_job_id FOREIGN KEY (job_id) REFERENCES job (id) ON DELETE CASCADE,
        CONSTRAINT fk_item_lease_token FOREIGN KEY (lease_token) REFERENCES lease (token)
    );
    CREATE INDEX ix_item_lease_token ON item (lease_token) WHERE lease_token IS NOT NULL;
    CREATE INDEX ix_item_ready ON item (job_id, queue, batch_key, solo, position)
        WHERE state = 'ready' AND run_after IS NULL;
    CREATE INDEX ix_item_run_after ON item (run_after) WHERE run_after IS NOT NULL;
    CREATE INDEX ix_item_text_key ON item (job_id, text_key) WHERE state = 'ready' AND stage = 'text';
    """,
    """
    CREATE TABLE motion (
        id UUID NOT NULL,
        tenant_id TEXT NOT NULL,
        job_id UUID NOT NULL,
        item_id UUID NOT NULL,
        licence TEXT NOT NULL,
        frames INTEGER NOT NULL,
        fps DOUBLE PRECISION NOT NULL,
        elapsed DOUBLE PRECISION NOT NULL,
        metadata JSONB NOT NULL,
        created_at TIMESTAMPTZ DEFAULT now() NOT NULL,
        CONSTRAINT pk_motion PRIMARY KEY (id),
        CONSTRAINT fk_motion_tenant_id FOREIGN KEY (tenant_id) REFERENCES tenant (id),
        CONSTRAINT fk_motion_job_id FOREIGN KEY (job_id) REFERENCES job (id) ON DELETE CASCADE,
        CONSTRAINT uq_motion_item_id UNIQUE (item_id),
        CONSTRAINT fk_motion_item_id FOREIGN KEY (item_id) REFERENCES item (id) ON DELETE CASCADE
    );
    CREATE INDEX ix_motion_job_id_id ON motion (job_id, id);
    CREATE INDEX ix_motion_tenant_id_id ON motion (tenant_id, id);
    """,
    """
    CREATE TABLE motion_file (
        motion_id UUID NOT NULL,
        format TEXT NOT NULL,
        asset_id UUID NOT NULL,
        CONSTRAINT pk_motion_file PRIMARY KEY (motion_id, format),
        CONSTRAINT fk_motion_file_motion_id FOREIGN KEY (motion_id) REFERENCES motion (id) ON DELETE CASCADE,
        CONSTRAINT fk_motion_file_asset_id FOREIGN KEY (asset_id) REFERENCES asset (id)
    );
    CREATE INDEX ix_motion_file_asset_id ON motion_file (asset_id);
    """,
)

# The table `TRANSITIONS` of shared/marey/jobs/states.py. A CHECK sees the new row alone, so a trigger does it.
ITEM_TRANSITION = """
    CREATE FUNCTION item_transition() RETURNS trigger LANGUAGE plpgsql AS $$
    BEGIN
        IF TG_OP = 'INSERT' THEN
            RAISE check_violation USING MESSAGE = format('an item begins ready, not %s', NEW.state);
        ELSIF (OLD.state, NEW.state) NOT IN (
            ('ready', 'leased'),
            ('leased', 'succeeded'),
            ('leased', 'ready'),
            ('leased', 'failed'),
            ('leased', 'dead'),
            ('ready', 'cancelled'),
            ('leased', 'cancelled'),
            ('failed', 'ready'),
            ('dead', 'ready'),
            ('cancelled', 'ready')
        ) THEN
            RAISE check_violation USING MESSAGE = format('an item may not go from %s to %s', OLD.state, NEW.state);
        END IF;
        RETURN NEW;
    END $$;
    CREATE TRIGGER item_transition BEFORE UPDATE OF state ON item
        FOR EACH ROW WHEN (OLD.state <> NEW.state) EXECUTE FUNCTION item_transition();
    CREATE TRIGGER item_begins_ready BEFORE INSERT ON item
        FOR EACH ROW WHEN (NEW.state <> 'ready') EXECUTE FUNCTION item_transition();
"""

DEFAULT_TENANT = "INSERT INTO tenant (id) VALUES ('default')"


def upgrade() -> None:
    for table in TABLES:
        op.execute(table)
    op.execute(ITEM_TRANSITION)
    op.execute(DEFAULT_TENANT)


def downgrade() -> None:
    for table in reversed(
        (
            "tenant",
            "text_features",
            "worker",
            "api_key",
            "asset",
            "job",
            "idempotency",
            "job_event",
            "lane",
            "lease",
            "asset_writer",
            "item",
            "motion",
            "motion_file",
        )
    ):
        op.execute(f"DROP TABLE {table}")
    op.execute("DROP FUNCTION item_transition()")
