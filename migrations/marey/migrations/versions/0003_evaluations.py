"""Evaluations, their reports, and schedules."""

from alembic import op

revision = "0003"
down_revision = "0002"
branch_labels = None
depends_on = None

PROMPT_SET = """
    CREATE TABLE prompt_set (
        tenant_id TEXT NOT NULL,
        sha256 TEXT NOT NULL,
        count INTEGER NOT NULL,
        prompts JSONB NOT NULL,
        CONSTRAINT pk_prompt_set PRIMARY KEY (tenant_id, sha256),
        CONSTRAINT ck_prompt_set_count CHECK (count > 0),
        CONSTRAINT fk_prompt_set_tenant_id FOREIGN KEY (tenant_id) REFERENCES tenant (id)
    );
"""

SCHEDULE = """
    CREATE TABLE schedule (
        id UUID NOT NULL,
        tenant_id TEXT NOT NULL,
        name TEXT,
        cron TEXT NOT NULL,
        time_zone TEXT NOT NULL,
        request JSONB NOT NULL,
        prompts_sha256 TEXT,
        paused BOOLEAN DEFAULT false NOT NULL,
        next_at TIMESTAMPTZ NOT NULL,
        created_at TIMESTAMPTZ DEFAULT now() NOT NULL,
        CONSTRAINT pk_schedule PRIMARY KEY (id),
        CONSTRAINT fk_schedule_tenant_id FOREIGN KEY (tenant_id) REFERENCES tenant (id),
        CONSTRAINT fk_schedule_prompts FOREIGN KEY (tenant_id, prompts_sha256)
            REFERENCES prompt_set (tenant_id, sha256)
    );
    CREATE INDEX ix_schedule_tenant_id_id ON schedule (tenant_id, id);
    CREATE INDEX ix_schedule_next_at ON schedule (next_at) WHERE NOT paused;
"""

EVALUATION = """
    CREATE TABLE evaluation (
        id UUID NOT NULL,
        tenant_id TEXT NOT NULL,
        schedule_id UUID,
        due_at TIMESTAMPTZ,
        name TEXT,
        comment TEXT,
        request JSONB NOT NULL,
        prompts_sha256 TEXT,
        state TEXT DEFAULT 'planned' NOT NULL,
        reason TEXT NOT NULL,
        generate_job_id UUID,
        score_job_id UUID,
        summary JSONB,
        regressed BOOLEAN,
        created_at TIMESTAMPTZ DEFAULT now() NOT NULL,
        started_at TIMESTAMPTZ,
        finished_at TIMESTAMPTZ,
        CONSTRAINT pk_evaluation PRIMARY KEY (id),
        CONSTRAINT uq_evaluation_schedule_id_due_at UNIQUE (schedule_id, due_at),
        CONSTRAINT ck_evaluation_state
            CHECK (state IN ('planned', 'generating', 'scoring', 'done', 'failed', 'cancelled')),
        CONSTRAINT ck_evaluation_finished
            CHECK ((finished_at IS NULL) = (state IN ('planned', 'generating', 'scoring'))),
        CONSTRAINT ck_evaluation_summary CHECK ((state = 'done') = (summary IS NOT NULL)),
        CONSTRAINT ck_evaluation_regressed CHECK (regressed IS NULL OR state = 'done'),
        CONSTRAINT ck_evaluation_prompts
            CHECK (state NOT IN ('generating', 'scoring', 'done') OR prompts_sha256 IS NOT NULL),
        CONSTRAINT fk_evaluation_tenant_id FOREIGN KEY (tenant_id) REFERENCES tenant (id),
        CONSTRAINT fk_evaluation_schedule_id FOREIGN KEY (schedule_id) REFERENCES schedule (id) ON DELETE SET NULL,
        CONSTRAINT fk_evaluation_generate_job_id
            FOREIGN KEY (generate_job_id) REFERENCES job (id) ON DELETE SET NULL,
        CONSTRAINT fk_evaluation_score_job_id FOREIGN KEY (score_job_id) REFERENCES job (id) ON DELETE SET NULL,
        CONSTRAINT fk_evaluation_prompts FOREIGN KEY (tenant_id, prompts_sha256)
            REFERENCES prompt_set (tenant_id, sha256)
    );
    CREATE INDEX ix_evaluation_tenant_id_id ON evaluation (tenant_id, id);
    CREATE INDEX ix_evaluation_schedule_id_id ON evaluation (schedule_id, id);
    CREATE INDEX ix_evaluation_open ON evaluation (id) WHERE finished_at IS NULL;
    CREATE INDEX ix_evaluation_done ON evaluation (tenant_id, prompts_sha256, id) WHERE state = 'done';
    CREATE INDEX ix_evaluation_generate_job_id ON evaluation (generate_job_id);
    CREATE INDEX ix_evaluation_score_job_id ON evaluation (score_job_id);
"""

EVENT = """
    CREATE TABLE evaluation_event (
        evaluation_id UUID NOT NULL,
        state TEXT NOT NULL,
        reason TEXT NOT NULL,
        at TIMESTAMPTZ NOT NULL,
        CONSTRAINT pk_evaluation_event PRIMARY KEY (evaluation_id, state),
        CONSTRAINT fk_evaluation_event_evaluation_id FOREIGN KEY (evaluation_id)
            REFERENCES evaluation (id) ON DELETE CASCADE
    );
"""

REPORT = """
    CREATE TABLE evaluation_report (
        evaluation_id UUID NOT NULL,
        format TEXT NOT NULL,
        asset_id UUID NOT NULL,
        CONSTRAINT pk_evaluation_report PRIMARY KEY (evaluation_id, format),
        CONSTRAINT ck_evaluation_report_format CHECK (format IN ('html', 'json', 'md')),
        CONSTRAINT fk_evaluation_report_evaluation_id FOREIGN KEY (evaluation_id)
            REFERENCES evaluation (id) ON DELETE CASCADE,
        CONSTRAINT fk_evaluation_report_asset_id FOREIGN KEY (asset_id) REFERENCES asset (id)
    );
    CREATE INDEX ix_evaluation_report_asset_id ON evaluation_report (asset_id);
"""

# The table `EVALUATION_TRANSITIONS` of shared/marey/jobs/states.py.
TRANSITION = """
    CREATE FUNCTION evaluation_transition() RETURNS trigger LANGUAGE plpgsql AS $$
    BEGIN
        IF TG_OP = 'INSERT' THEN
            RAISE check_violation USING MESSAGE = format('an evaluation begins planned, not %s', NEW.state);
        ELSIF (OLD.state, NEW.state) NOT IN (
            ('planned', 'generating'),
            ('planned', 'failed'),
            ('planned', 'cancelled'),
            ('generating', 'scoring'),
            ('generating', 'failed'),
            ('generating', 'cancelled'),
            ('scoring', 'done'),
            ('scoring', 'failed'),
            ('scoring', 'cancelled')
        ) THEN
            RAISE check_violation
                USING MESSAGE = format('an evaluation may not go from %s to %s', OLD.state, NEW.state);
        END IF;
        RETURN NEW;
    END $$;
    CREATE TRIGGER evaluation_transition BEFORE UPDATE OF state ON evaluation
        FOR EACH ROW WHEN (OLD.state <> NEW.state) EXECUTE FUNCTION evaluation_transition();
    CREATE TRIGGER evaluation_begins_planned BEFORE INSERT ON evaluation
        FOR EACH ROW WHEN (NEW.state <> 'planned') EXECUTE FUNCTION evaluation_transition();
"""


def upgrade() -> None:
    for statement in (PROMPT_SET, SCHEDULE, EVALUATION, EVENT, REPORT, TRANSITION):
        op.execute(statement)


def downgrade() -> None:
    for table in ("evaluation_report", "evaluation_event", "evaluation", "schedule", "prompt_set"):
        op.execute(f"DROP TABLE {table}")
    op.execute("DROP FUNCTION evaluation_transition()")
