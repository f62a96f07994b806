"""The tables. `migrations/` makes them; a test compares the two. Those of webhooks stand in `webhook_schema.py`.

The rows of `job` and `lane` change with every claim and commit. No index names what changes in them, and their pages
are half empty, so that Postgres cleans up behind each update by itself (heap-only tuples) and a claim costs the same
after thousands of others. Lanes of jobs that have ended are deleted.

Lock order, so that nothing deadlocks: schedule row, evaluation row, job row, lease row, item rows, lane rows, asset
rows, tenant row. Who holds a job's lock may change everything about that job; the heartbeat takes a lease row alone.
Under the tenant's lock claims and submits count what there is of a quota, one after the other.
"""

from __future__ import annotations

import sqlalchemy as sa
from sqlalchemy.dialects.postgresql import ARRAY, BYTEA, JSONB, TIMESTAMP, UUID

from shared.jobs.states import EvaluationState, ItemState, JobControl, Review, Stage, StreamState

metadata = sa.MetaData(
    naming_convention={
        "ix": "ix_%(table_name)s_%(column_0_N_name)s",
        "uq": "uq_%(table_name)s_%(column_0_N_name)s",
        "ck": "ck_%(table_name)s_%(constraint_name)s",
        "fk": "fk_%(table_name)s_%(column_0_name)s",
        "pk": "pk_%(table_name)s",
    }
)

Time = TIMESTAMP(timezone=True)
Id = UUID(as_uuid=True)
NOW = sa.text("now()")


def _one_of(column: str, values: list[str]) -> str:
    return f"{column} IN ({', '.join(repr(str(value)) for value in values)})"


# The rule of `states.job_state`.
JOB_STATE = """CASE
  WHEN ready + leased > 0 THEN
    CASE WHEN control = 'paused' THEN 'paused' WHEN started_at IS NULL THEN 'queued' ELSE 'running' END
  WHEN total = 0 THEN 'queued'
  WHEN succeeded = total THEN 'succeeded'
  WHEN control = 'cancelled' THEN 'cancelled'
  WHEN succeeded > 0 THEN 'partial'
  ELSE 'failed'
END"""

tenant = sa.Table(
    "tenant",
    metadata,
    sa.Column("id", sa.Text, primary_key=True),
    sa.Column("created_at", Time, nullable=False, server_default=NOW),
    sa.Column("suspended_at", Time),  # set = no request is answered, nothing is claimed
    # Quotas; null = none. What is used of them is counted where it stands: a counter of its own could drift.
    sa.Column("max_queued", sa.Integer),
    sa.Column("max_running", sa.Integer),
    sa.Column("max_bytes", sa.BigInteger),
    sa.Column("max_streams", sa.Integer),  # open ones of one key; null = MAREY_STREAMS_PER_KEY
    sa.CheckConstraint("id ~ '^[a-z0-9][a-z0-9_-]{0,62}$'", name="id"),  # it stands in the keys of the asset store
    sa.CheckConstraint("least(max_queued, max_running, max_bytes, max_streams) >= 0", name="quotas"),
)

api_key = sa.Table(
    "api_key",
    metadata,
    sa.Column("id", Id, primary_key=True),
    sa.Column("tenant_id", sa.Text, sa.ForeignKey("tenant.id"), nullable=False),
    sa.Column("name", sa.Text, nullable=False),
    sa.Column("prefix", sa.Text, nullable=False, unique=True),
    sa.Column("secret_sha256", BYTEA, nullable=False),
    sa.Column("scopes", ARRAY(sa.Text), nullable=False),
    sa.Column("created_at", Time, nullable=False, server_default=NOW),
    sa.Column("last_used_at", Time),  # within a minute
    sa.Column("expires_at", Time),
    sa.Column("revoked_at", Time),
    sa.Column("replaced_by", Id, sa.ForeignKey("api_key.id")),  # it was rotated
    sa.Column("rates", JSONB, nullable=False, server_default=sa.text("'{}'")),  # {"submit": "60/minute"}: its own
    sa.Index("ix_api_key_tenant_id_id", "tenant_id", "id"),
)

job = sa.Table(
    "job",
    metadata,
    sa.Column("id", Id, primary_key=True),
    sa.Column("tenant_id", sa.Text, sa.ForeignKey("tenant.id"), nullable=False),
    sa.Column("name", sa.Text),
    sa.Column("comment", sa.Text),
    sa.Column("priority", sa.Integer, nullable=False, server_default="0"),
    sa.Column("control", sa.Text, nullable=False, server_default="run"),
    sa.Column("fail_early", sa.Double),
    sa.Column("total", sa.Integer, nullable=False, server_default="0"),
    sa.Column("ready", sa.Integer, nullable=False, server_default="0"),
    sa.Column("leased", sa.Integer, nullable=False, server_default="0"),
    sa.Column("succeeded", sa.Integer, nullable=False, server_default="0"),
    sa.Column("failed", sa.Integer, nullable=False, server_default="0"),
    sa.Column("dead", sa.Integer, nullable=False, server_default="0"),
    sa.Column("cancelled", sa.Integer, nullable=False, server_default="0"),
    sa.Column("state", sa.Text, sa.Computed(JOB_STATE, persisted=True), nullable=False),
    sa.Column("event_seq", sa.BigInteger, nullable=False, server_default="0"),
    sa.Column("created_at", Time, nullable=False, server_default=NOW),
    sa.Column("started_at", Time),
    sa.Column("finished_at", Time),
    sa.Column("keep_days", sa.Integer),  # deleted this long after it ended; null = by hand alone
    sa.Column("erased_at", Time),  # its prompts are gone
    sa.Column("traceparent", sa.Text),  # of the request that submitted it: what is done for it goes on from there
    sa.CheckConstraint(_one_of("control", list(JobControl)), name="control"),
    sa.CheckConstraint("priority BETWEEN -1000 AND 1000", name="priority"),
    sa.CheckConstraint("fail_early BETWEEN 0 AND 1", name="fail_early"),
    sa.CheckConstraint(
        "least(ready, leased, succeeded, failed, dead, cancelled) >= 0"
        " AND ready + leased + succeeded + failed + dead + cancelled = total",
        name="counters",
    ),
    sa.CheckConstraint("keep_days BETWEEN 1 AND 36500", name="keep_days"),
    sa.CheckConstraint("traceparent ~ '^00-[0-9a-f]{32}-[0-9a-f]{16}-[0-9a-f]{2}$'", name="traceparent"),
    sa.Index("ix_job_tenant_id_id", "tenant_id", "id"),
    sa.Index("ix_job_keep_days", "id", postgresql_where=sa.text("keep_days IS NOT NULL")),
    # For counting what a tenant has in the queue. Its predicate changes once in a job's life.
    sa.Index("ix_job_open", "tenant_id", postgresql_where=sa.text("finished_at IS NULL")),
    postgresql_with={"fillfactor": 50},
)

item = sa.Table(
    "item",
    metadata,
    sa.Column("id", Id, primary_key=True),
    sa.Column("job_id", Id, sa.ForeignKey("job.id", ondelete="CASCADE"), nullable=False),
    sa.Column("position", sa.Integer, nullable=False),  # input order, variants within prompt
    sa.Column("index", sa.Integer, nullable=False),
    sa.Column("variant", sa.Integer, nullable=False),
    sa.Column("name", sa.Text),
    sa.Column("prompt", sa.Text, nullable=False),
    sa.Column("model", sa.Text, nullable=False),
    sa.Column("bundle", sa.Text, nullable=False),
    sa.Column("seed", sa.Integer, nullable=False),
    sa.Column("seconds", sa.Double),
    sa.Column("settings", JSONB, nullable=False),
    sa.Column("tags", ARRAY(sa.Text), nullable=False),
    sa.Column("text_key", sa.Text, nullable=False),
    sa.Column("generate_batch_key", sa.Text, nullable=False),
    sa.Column("stage", sa.Text, nullable=False),
    sa.Column("queue", sa.Text, nullable=False),  # queue and batch key of this stage: its lane, within the job
    sa.Column("batch_key", sa.Text, nullable=False),
    sa.Column("state", sa.Text, nullable=False, server_default="ready"),
    sa.Column("reason", sa.Text),
    sa.Column("attempts", sa.Integer, nullable=False, server_default="0"),
    sa.Column("solo", sa.Boolean, nullable=False, server_default=sa.false()),
    sa.Column("run_after", Time),  # set = not in its lane; the sweeper puts it back
    sa.Column("lease_token", Id, sa.ForeignKey("lease.token")),
    sa.Column("problem", JSONB),
    sa.Column("created_at", Time, nullable=False, server_default=NOW),
    sa.Column("finished_at", Time),
    # The motion that this item is another take of.
    sa.Column("replaces", Id, sa.ForeignKey("motion.id", ondelete="SET NULL", use_alter=True)),
    sa.CheckConstraint(_one_of("state", list(ItemState)), name="state"),
    sa.CheckConstraint(_one_of("stage", list(Stage)), name="stage"),
    sa.CheckConstraint("(state = 'leased') = (lease_token IS NOT NULL)", name="lease"),
    sa.CheckConstraint("run_after IS NULL OR state = 'ready'", name="run_after"),
    sa.CheckConstraint("(finished_at IS NULL) = (state IN ('ready', 'leased'))", name="finished"),
    sa.CheckConstraint("state <> 'succeeded' OR stage = 'generate'", name="succeeded"),
    sa.CheckConstraint("seed >= 0", name="seed"),
    sa.UniqueConstraint("job_id", "position"),
    # The claim's order: within a lane by position, those that must run alone apart.
    sa.Index(
        "ix_item_ready",
        *("job_id", "queue", "batch_key", "solo", "position"),
        postgresql_where=sa.text("state = 'ready' AND run_after IS NULL"),
    ),
    sa.Index("ix_item_run_after", "run_after", postgresql_where=sa.text("run_after IS NOT NULL")),
    sa.Index("ix_item_lease_token", "lease_token", postgresql_where=sa.text("lease_token IS NOT NULL")),
    sa.Index("ix_item_text_key", "job_id", "text_key", postgresql_where=sa.text("state = 'ready' AND stage = 'text'")),
    sa.Index("ix_item_replaces", "replaces", unique=True, postgresql_where=sa.text("replaces IS NOT NULL")),
    # What motions are searched by. Items that succeeded alone are in them: a submit pays nothing.
    sa.Index(
        "ix_item_tags",
        "tags",
        postgresql_using="gin",
        postgresql_where=sa.text("state = 'succeeded' AND tags <> '{}'"),
    ),
    sa.Index(
        "ix_item_name",
        sa.func.lower(sa.literal_column("name")).label("lower_name"),
        postgresql_ops={"lower_name": "text_pattern_ops"},
        postgresql_where=sa.text("state = 'succeeded' AND name IS NOT NULL"),
    ),
    sa.Index(
        "ix_item_words",
        sa.text("to_tsvector('english'::regconfig, prompt)"),
        postgresql_using="gin",
        postgresql_where=sa.text("state = 'succeeded'"),
    ),
)

lane = sa.Table(
    "lane",
    metadata,
    sa.Column("job_id", Id, sa.ForeignKey("job.id", ondelete="CASCADE"), primary_key=True),
    sa.Column("queue", sa.Text, primary_key=True),
    sa.Column("batch_key", sa.Text, primary_key=True),
    sa.Column("ready", sa.Integer, nullable=False),  # claimable now, in company
    sa.Column("solo", sa.Integer, nullable=False),  # claimable now, alone
    sa.Column("waiting_since", Time, nullable=False, server_default=NOW),  # last claim, or when it stopped being empty
    sa.CheckConstraint("ready >= 0 AND solo >= 0", name="counters"),
    sa.Index("ix_lane_queue", "queue"),
    postgresql_with={"fillfactor": 50},
)

lease = sa.Table(
    "lease",
    metadata,
    sa.Column("token", Id, primary_key=True),
    sa.Column("job_id", Id, sa.ForeignKey("job.id", ondelete="CASCADE"), nullable=False),
    sa.Column("queue", sa.Text, nullable=False),
    sa.Column("worker", sa.Text, nullable=False),
    sa.Column("solo", sa.Boolean, nullable=False),
    sa.Column("claimed_at", Time, nullable=False),
    sa.Column("progress_at", Time, nullable=False),
    sa.Column("expires_at", Time, nullable=False),
    sa.Index("ix_lease_expires_at", "expires_at"),
    sa.Index("ix_lease_job_id", "job_id"),
)

worker = sa.Table(
    "worker",
    metadata,
    sa.Column("id", sa.Text, primary_key=True),
    sa.Column("queue", sa.Text, nullable=False),
    sa.Column("host", sa.Text, nullable=False),
    sa.Column("pid", sa.Integer, nullable=False),
    sa.Column("device", sa.Text, nullable=False),
    sa.Column("bundle", sa.Text),
    sa.Column("batch_key", sa.Text),
    sa.Column("started_at", Time, nullable=False),
    sa.Column("seen_at", Time, nullable=False),
)

text_features = sa.Table(
    "text_features",
    metadata,
    sa.Column("key", sa.Text, primary_key=True),
    sa.Column("blob", BYTEA, nullable=False),
    sa.Column("created_at", Time, nullable=False, server_default=NOW),
)

asset = sa.Table(
    "asset",
    metadata,
    sa.Column("id", Id, primary_key=True),
    sa.Column("tenant_id", sa.Text, sa.ForeignKey("tenant.id"), nullable=False),
    sa.Column("sha256", sa.Text, nullable=False),
    sa.Column("size", sa.BigInteger, nullable=False),
    sa.Column("media_type", sa.Text, nullable=False),
    sa.Column("state", sa.Text, nullable=False),
    sa.Column("created_at", Time, nullable=False, server_default=NOW),
    sa.Column("announced_at", Time, nullable=False),  # when somebody last said they would PUT it
    sa.UniqueConstraint("tenant_id", "sha256"),
    sa.CheckConstraint("state IN ('writing', 'stored')", name="state"),
    sa.CheckConstraint("sha256 ~ '^[0-9a-f]{64}$'", name="sha256"),
    sa.Index("ix_asset_writing", "announced_at", postgresql_where=sa.text("state = 'writing'")),
    sa.Index("ix_asset_stored", "tenant_id", postgresql_include=["size"], postgresql_where=sa.text("state = 'stored'")),
)

# Who is writing what: two leases may produce the same content at once, and each keeps it from the collector.
asset_writer = sa.Table(
    "asset_writer",
    metadata,
    sa.Column("asset_id", Id, sa.ForeignKey("asset.id", ondelete="CASCADE"), primary_key=True),
    sa.Column("lease_token", Id, sa.ForeignKey("lease.token", ondelete="CASCADE"), primary_key=True),
    sa.Index("ix_asset_writer_lease_token", "lease_token"),
)

motion = sa.Table(
    "motion",
    metadata,
    sa.Column("id", Id, primary_key=True),
    sa.Column("tenant_id", sa.Text, sa.ForeignKey("tenant.id"), nullable=False),
    sa.Column("job_id", Id, sa.ForeignKey("job.id", ondelete="CASCADE"), nullable=False),
    sa.Column("item_id", Id, sa.ForeignKey("item.id", ondelete="CASCADE"), nullable=False, unique=True),
    sa.Column("licence", sa.Text, nullable=False),
    sa.Column("frames", sa.Integer, nullable=False),
    sa.Column("fps", sa.Double, nullable=False),
    sa.Column("elapsed", sa.Double, nullable=False),
    sa.Column("metadata", JSONB, nullable=False),
    sa.Column("created_at", Time, nullable=False, server_default=NOW),
    sa.Column("review", sa.Text),  # null = nobody looked at it yet
    sa.Column("reviewed_at", Time),
    sa.Column("reviewed_by", sa.Text),  # the name of an API key
    sa.Column("review_comment", sa.Text),
    sa.CheckConstraint(_one_of("review", list(Review)), name="review"),
    sa.CheckConstraint("num_nulls(review, reviewed_at, reviewed_by) IN (0, 3)", name="reviewed"),
    sa.CheckConstraint("review IS NOT NULL OR review_comment IS NULL", name="review_comment"),
    sa.Index("ix_motion_tenant_id_id", "tenant_id", "id"),
    sa.Index("ix_motion_job_id_id", "job_id", "id"),
    sa.Index("ix_motion_review", "tenant_id", "review", "id", postgresql_where=sa.text("review IS NOT NULL")),
)

motion_file = sa.Table(
    "motion_file",
    metadata,
    sa.Column("motion_id", Id, sa.ForeignKey("motion.id", ondelete="CASCADE"), primary_key=True),
    sa.Column("format", sa.Text, primary_key=True),
    sa.Column("asset_id", Id, sa.ForeignKey("asset.id"), nullable=False),
    # It holds an erased prompt and waits to be written anew: nobody gets it any more.
    sa.Column("erasing", sa.Boolean, nullable=False, server_default=sa.false()),
    sa.Index("ix_motion_file_asset_id", "asset_id"),
    sa.Index("ix_motion_file_erasing", "motion_id", postgresql_where=sa.text("erasing")),
)

job_event = sa.Table(
    "job_event",
    metadata,
    sa.Column("job_id", Id, sa.ForeignKey("job.id", ondelete="CASCADE"), primary_key=True),
    sa.Column("seq", sa.BigInteger, primary_key=True, autoincrement=False),
    sa.Column("kind", sa.Text, nullable=False),
    sa.Column("item_id", Id),
    sa.Column("reason", sa.Text, nullable=False),
    sa.Column("data", JSONB, nullable=False),
    sa.Column("at", Time, nullable=False),
)

idempotency = sa.Table(
    "idempotency",
    metadata,
    sa.Column("tenant_id", sa.Text, sa.ForeignKey("tenant.id"), primary_key=True),
    sa.Column("key", sa.Text, primary_key=True),
    sa.Column("body_sha256", sa.Text, nullable=False),
    # Checked at commit: the key is taken first, so that a second submit waits for the first and writes nothing.
    sa.Column(
        "job_id",
        Id,
        sa.ForeignKey("job.id", ondelete="CASCADE", deferrable=True, initially="DEFERRED"),
        index=True,
    ),
    sa.Column("created_at", Time, nullable=False),
    sa.Column(
        "evaluation_id",
        Id,
        sa.ForeignKey("evaluation.id", ondelete="CASCADE", deferrable=True, initially="DEFERRED"),
        index=True,
    ),
    sa.CheckConstraint("num_nonnulls(job_id, evaluation_id) = 1", name="made"),
    sa.Index("ix_idempotency_created_at", "created_at"),
)

stream = sa.Table(
    "stream",
    metadata,
    sa.Column("id", Id, primary_key=True),
    sa.Column("tenant_id", sa.Text, sa.ForeignKey("tenant.id"), nullable=False),
    sa.Column("key_id", Id, sa.ForeignKey("api_key.id"), nullable=False),
    sa.Column("name", sa.Text),
    sa.Column("prompt", sa.Text, nullable=False),  # the first; later ones stand in chunks
    sa.Column("model", sa.Text, nullable=False),
    sa.Column("bundle", sa.Text, nullable=False),
    sa.Column("seed", sa.Integer, nullable=False),
    sa.Column("max_frames", sa.Integer, nullable=False),
    sa.Column("state", sa.Text, nullable=False, server_default="waiting"),
    sa.Column("reason", sa.Text),
    sa.Column("problem", JSONB),
    sa.Column("fence", sa.BigInteger, nullable=False, server_default="0"),  # number of the newest lease that wrote here
    sa.Column("worker", sa.Text),
    sa.Column("control", sa.Text, nullable=False, server_default="0-0"),  # id of the last message that was obeyed
    sa.Column("frames", sa.Integer, nullable=False, server_default="0"),  # those whose tokens stand in chunks
    sa.Column("job_id", Id, sa.ForeignKey("job.id", ondelete="SET NULL")),  # makes the clip, once it has ended
    sa.Column("created_at", Time, nullable=False, server_default=NOW),
    sa.Column("started_at", Time),
    sa.Column("seen_at", Time, nullable=False, server_default=NOW),  # its worker last wrote here
    sa.Column("ended_at", Time),
    sa.CheckConstraint(_one_of("state", list(StreamState)), name="state"),
    sa.CheckConstraint("(ended_at IS NULL) = (state IN ('waiting', 'live', 'paused'))", name="ended"),
    sa.CheckConstraint("seed >= 0", name="seed"),
    sa.CheckConstraint("frames >= 0 AND max_frames > 0", name="frames"),
    sa.Index("ix_stream_tenant_id_id", "tenant_id", "id"),
    sa.Index("ix_stream_open", "bundle", "id", postgresql_where=sa.text("ended_at IS NULL")),
    sa.Index("ix_stream_key_id", "key_id", postgresql_where=sa.text("ended_at IS NULL")),
    sa.Index("ix_stream_job_id", "job_id"),
)

stream_chunk = sa.Table(
    "stream_chunk",
    metadata,
    sa.Column("stream_id", Id, sa.ForeignKey("stream.id", ondelete="CASCADE"), primary_key=True),
    sa.Column("first", sa.Integer, primary_key=True, autoincrement=False),  # number of its first frame
    sa.Column("tokens", BYTEA, nullable=False),  # int16, little-endian, a column of V levels a frame
    sa.Column("prompts", JSONB, nullable=False),  # those that came into force in it: [[frame, text], ...]
)

# Prompts of evaluations, by the digest of their content: a schedule and all its runs share one row.
prompt_set = sa.Table(
    "prompt_set",
    metadata,
    sa.Column("tenant_id", sa.Text, sa.ForeignKey("tenant.id"), primary_key=True),
    sa.Column("sha256", sa.Text, primary_key=True),
    sa.Column("count", sa.Integer, nullable=False),
    sa.Column("prompts", JSONB, nullable=False),  # [{"prompt", "seconds"?, "expected"?}, ...]
    sa.CheckConstraint("count > 0", name="count"),
)

schedule = sa.Table(
    "schedule",
    metadata,
    sa.Column("id", Id, primary_key=True),
    sa.Column("tenant_id", sa.Text, sa.ForeignKey("tenant.id"), nullable=False),
    sa.Column("name", sa.Text),
    sa.Column("cron", sa.Text, nullable=False),
    sa.Column("time_zone", sa.Text, nullable=False),
    sa.Column("request", JSONB, nullable=False),  # names as they were given: each run looks up the exact bundles
    sa.Column("prompts_sha256", sa.Text),  # null = those of the evaluator's bundle
    sa.Column("paused", sa.Boolean, nullable=False, server_default=sa.false()),
    sa.Column("next_at", Time, nullable=False),  # means nothing while paused
    sa.Column("created_at", Time, nullable=False, server_default=NOW),
    sa.ForeignKeyConstraint(
        ["tenant_id", "prompts_sha256"],
        ["prompt_set.tenant_id", "prompt_set.sha256"],
        name="fk_schedule_prompts",
    ),
    sa.Index("ix_schedule_tenant_id_id", "tenant_id", "id"),
    sa.Index("ix_schedule_next_at", "next_at", postgresql_where=sa.text("NOT paused")),
)

evaluation = sa.Table(
    "evaluation",
    metadata,
    sa.Column("id", Id, primary_key=True),
    sa.Column("tenant_id", sa.Text, sa.ForeignKey("tenant.id"), nullable=False),
    sa.Column("schedule_id", Id, sa.ForeignKey("schedule.id", ondelete="SET NULL")),
    sa.Column("due_at", Time),  # the time of its schedule that it stands for; null = somebody asked for it
    sa.Column("name", sa.Text),
    sa.Column("comment", sa.Text),
    sa.Column("request", JSONB, nullable=False),  # exact once it is generating
    sa.Column("prompts_sha256", sa.Text),  # known once it is generating
    sa.Column("state", sa.Text, nullable=False, server_default="planned"),
    sa.Column("reason", sa.Text, nullable=False),  # why it came to this state
    sa.Column("generate_job_id", Id, sa.ForeignKey("job.id", ondelete="SET NULL")),
    sa.Column("score_job_id", Id, sa.ForeignKey("job.id", ondelete="SET NULL")),
    sa.Column("summary", JSONB),
    sa.Column("regressed", sa.Boolean),  # null = there was nothing to compare with
    sa.Column("created_at", Time, nullable=False, server_default=NOW),
    sa.Column("started_at", Time),
    sa.Column("finished_at", Time),
    sa.ForeignKeyConstraint(
        ["tenant_id", "prompts_sha256"],
        ["prompt_set.tenant_id", "prompt_set.sha256"],
        name="fk_evaluation_prompts",
    ),
    sa.CheckConstraint(_one_of("state", list(EvaluationState)), name="state"),
    sa.CheckConstraint("(finished_at IS NULL) = (state IN ('planned', 'generating', 'scoring'))", name="finished"),
    sa.CheckConstraint("(state = 'done') = (summary IS NOT NULL)", name="summary"),
    sa.CheckConstraint("regressed IS NULL OR state = 'done'", name="regressed"),
    sa.CheckConstraint("state NOT IN ('generating', 'scoring', 'done') OR prompts_sha256 IS NOT NULL", name="prompts"),
    sa.UniqueConstraint("schedule_id", "due_at"),
    sa.Index("ix_evaluation_tenant_id_id", "tenant_id", "id"),
    sa.Index("ix_evaluation_schedule_id_id", "schedule_id", "id"),
    sa.Index("ix_evaluation_open", "id", postgresql_where=sa.text("finished_at IS NULL")),
    # What the next run is compared with: the last one of the same prompts.
    sa.Index("ix_evaluation_done", "tenant_id", "prompts_sha256", "id", postgresql_where=sa.text("state = 'done'")),
    sa.Index("ix_evaluation_generate_job_id", "generate_job_id"),
    sa.Index("ix_evaluation_score_job_id", "score_job_id"),
)

evaluation_event = sa.Table(
    "evaluation_event",
    metadata,
    sa.Column("evaluation_id", Id, sa.ForeignKey("evaluation.id", ondelete="CASCADE"), primary_key=True),
    sa.Column("state", sa.Text, primary_key=True),  # no state is entered twice
    sa.Column("reason", sa.Text, nullable=False),
    sa.Column("at", Time, nullable=False),
)

evaluation_report = sa.Table(
    "evaluation_report",
    metadata,
    sa.Column("evaluation_id", Id, sa.ForeignKey("evaluation.id", ondelete="CASCADE"), primary_key=True),
    sa.Column("format", sa.Text, primary_key=True),
    sa.Column("asset_id", Id, sa.ForeignKey("asset.id"), nullable=False),
    sa.CheckConstraint("format IN ('html', 'json', 'md')", name="format"),
    sa.Index("ix_evaluation_report_asset_id", "asset_id"),
)

# Who did what, when. Refers to nothing: it outlives what it is about.
audit_event = sa.Table(
    "audit_event",
    metadata,
    sa.Column("id", Id, primary_key=True),
    sa.Column("at", Time, nullable=False),
    sa.Column("tenant_id", sa.Text, nullable=False),
    sa.Column("key_id", Id),  # null = somebody beside the database (`marey admin`)
    sa.Column("actor", sa.Text, nullable=False),  # name of the key, or who ran the command
    sa.Column("verb", sa.Text, nullable=False),
    sa.Column("target", sa.Text, nullable=False),
    sa.Column("data", JSONB, nullable=False),  # no prompts, no secrets
    sa.Index("ix_audit_event_tenant_id_id", "tenant_id", "id"),
    sa.Index("ix_audit_event_at", "at"),
)
