"""Live streams and their tokens."""

from alembic import op

revision = "0002"
down_revision = "0001"
branch_labels = None
depends_on = None

STREAM = """
    CREATE TABLE stream (
        id UUID NOT NULL,
        tenant_id TEXT NOT NULL,
        key_id UUID NOT NULL,
        name TEXT,
        prompt TEXT NOT NULL,
        model TEXT NOT NULL,
        bundle TEXT NOT NULL,
        seed INTEGER NOT NULL,
        max_frames INTEGER NOT NULL,
        state TEXT DEFAULT 'waiting' NOT NULL,
        reason TEXT,
        problem JSONB,
        fence BIGINT DEFAULT 0 NOT NULL,
        worker TEXT,
        control TEXT DEFAULT '0-0' NOT NULL,
        frames INTEGER DEFAULT 0 NOT NULL,
        job_id UUID,
        created_at TIMESTAMPTZ DEFAULT now() NOT NULL,
        started_at TIMESTAMPTZ,
        seen_at TIMESTAMPTZ DEFAULT now() NOT NULL,
        ended_at TIMESTAMPTZ,
        CONSTRAINT pk_stream PRIMARY KEY (id),
        CONSTRAINT ck_stream_state CHECK (state IN ('waiting', 'live', 'paused', 'ended', 'failed')),
        CONSTRAINT ck_stream_ended CHECK ((ended_at IS NULL) = (state IN ('waiting', 'live', 'paused'))),
        CONSTRAINT ck_stream_seed CHECK (seed >= 0),
        CONSTRAINT ck_stream_frames CHECK (frames >= 0 AND max_frames > 0),
        CONSTRAINT fk_stream_tenant_id FOREIGN KEY (tenant_id) REFERENCES tenant (id),
        CONSTRAINT fk_stream_key_id FOREIGN KEY (key_id) REFERENCES api_key (id),
        CONSTRAINT fk_stream_job_id FOREIGN KEY (job_id) REFERENCES job (id) ON DELETE SET NULL
    );
    CREATE INDEX ix_stream_tenant_id_id ON stream (tenant_id, id);
    CREATE INDEX ix_stream_open ON stream (bundle, id) WHERE ended_at IS NULL;
    CREATE INDEX ix_stream_key_id ON stream (key_id) WHERE ended_at IS NULL;
    CREATE INDEX ix_stream_job_id ON stream (job_id);
"""

CHUNK = """
    CREATE TABLE stream_chunk (
        stream_id UUID NOT NULL,
        first INTEGER NOT NULL,
        tokens BYTEA NOT NULL,
        prompts JSONB NOT NULL,
        CONSTRAINT pk_stream_chunk PRIMARY KEY (stream_id, first),
        CONSTRAINT fk_stream_chunk_stream_id FOREIGN KEY (stream_id) REFERENCES stream (id) ON DELETE CASCADE
    );
"""

# The table `STREAM_TRANSITIONS` of shared/marey/jobs/states.py.
TRANSITION = """
    CREATE FUNCTION stream_transition() RETURNS trigger LANGUAGE plpgsql AS $$
    BEGIN
        IF TG_OP = 'INSERT' THEN
            RAISE check_violation USING MESSAGE = format('a stream begins waiting, not %s', NEW.state);
        ELSIF (OLD.state, NEW.state) NOT IN (
            ('waiting', 'live'),
            ('waiting', 'ended'),
            ('waiting', 'failed'),
            ('live', 'paused'),
            ('live', 'ended'),
            ('live', 'failed'),
            ('paused', 'live'),
            ('paused', 'ended'),
            ('paused', 'failed')
        ) THEN
            RAISE check_violation USING MESSAGE = format('a stream may not go from %s to %s', OLD.state, NEW.state);
        END IF;
        RETURN NEW;
    END $$;
    CREATE TRIGGER stream_transition BEFORE UPDATE OF state ON stream
        FOR EACH ROW WHEN (OLD.state <> NEW.state) EXECUTE FUNCTION stream_transition();
    CREATE TRIGGER stream_begins_waiting BEFORE INSERT ON stream
        FOR EACH ROW WHEN (NEW.state <> 'waiting') EXECUTE FUNCTION stream_transition();
"""


def upgrade() -> None:
    for statement in (STREAM, CHUNK, TRANSITION):
        op.execute(statement)


def downgrade() -> None:
    op.execute("DROP TABLE stream_chunk")
    op.execute("DROP TABLE stream")
    op.execute("DROP FUNCTION stream_transition()")
