"""Tables of jobs, items and leases, and of the motions and files that items become.

The rows of `job` and `lane` change with every claim and commit. No index covers the changing columns, and pages are
half empty, so that Postgres cleans up within the page (heap-only tuples) and a claim costs the same after thousands
of others. Lanes of jobs that have ended are deleted.

Lock order, to prevent deadlocks: schedule row, evaluation row, job row, lease row, item rows, lane rows, asset rows,
tenant row. The holder of a job's lock may change everything of that job; the heartbeat takes a lease row alone.
Claims and submits count quotas under the tenant's lock, one after the other.
"""

from __future__ import annotations

import sqlalchemy as sa
from sqlalchemy.dialects.postgresql import ARRAY, BYTEA, JSONB, TSVECTOR

from marey.db.tables import NOW, Id, Time, metadata, one_of, short_id
from marey.jobs.states import ItemStage, ItemState, JobControl, JobKind, Review
from marey.vocabulary.scope import POLICIES

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
    sa.Column("keep_days", sa.Integer),  # deleted this long after it ended; null = only by hand
    sa.Column("erased_at", Time),  # its prompts were erased
    sa.Column("traceparent", sa.Text),  # `traceparent` of the submitting request
    sa.Column("scope", sa.Text, nullable=False, server_default="ignore"),  # treatment of unknown prompts
    sa.CheckConstraint(one_of("control", list(JobControl)), name="control"),
    sa.CheckConstraint("priority BETWEEN -1000 AND 1000", name="priority"),
    sa.CheckConstraint("fail_early BETWEEN 0 AND 1", name="fail_early"),
    sa.CheckConstraint(
        "least(ready, leased, succeeded, failed, dead, cancelled) >= 0"
        " AND ready + leased + succeeded + failed + dead + cancelled = total",
        name="counters",
    ),
    sa.CheckConstraint("keep_days BETWEEN 1 AND 36500", name="keep_days"),
    sa.Column("kind", sa.Text, nullable=False, server_default=str(JobKind.GENERATE)),
    sa.CheckConstraint(one_of("scope", POLICIES), name="scope"),
    sa.CheckConstraint(one_of("kind", list(JobKind)), name="kind"),
    sa.CheckConstraint("traceparent ~ '^00-[0-9a-f]{32}-[0-9a-f]{16}-[0-9a-f]{2}$'", name="traceparent"),
    sa.Index("ix_job_tenant_id_id", "tenant_id", "id"),  # the order of earlier releases
    sa.Index("ix_job_created", "tenant_id", "created_at", "id"),
    sa.Index("ix_job_short_id", "tenant_id", short_id()),
    sa.Index("ix_job_name", "tenant_id", "name", postgresql_where=sa.text("name IS NOT NULL")),
    sa.Index("ix_job_keep_days", "id", postgresql_where=sa.text("keep_days IS NOT NULL")),
    # For counting a tenant's queued items. Its predicate changes once in a job's life.
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
    sa.Column("scope", JSONB),  # `marey.vocabulary.scope.Scope`; null = not examined
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
    sa.Column("run_after", Time),  # set = not in its lane; the sweeper returns it
    sa.Column("lease_token", Id, sa.ForeignKey("lease.token")),
    sa.Column("problem", JSONB),
    sa.Column("created_at", Time, nullable=False, server_default=NOW),
    sa.Column("finished_at", Time),
    # Replaced motion of a re-roll.
    sa.Column("replaces", Id, sa.ForeignKey("motion.id", ondelete="SET NULL", use_alter=True)),
    sa.Column("edits", JSONB),  # `marey.jobs.types.Edits`; null = not an edit
    sa.Column("timeline", JSONB),  # `marey.items.timeline`; null = the prompt alone
    sa.Column("constraints", JSONB),  # `marey.items.constraints`; null = none
    sa.CheckConstraint(one_of("state", list(ItemState)), name="state"),
    sa.CheckConstraint(one_of("stage", list(ItemStage)), name="stage"),
    sa.CheckConstraint("(state = 'leased') = (lease_token IS NOT NULL)", name="lease"),
    sa.CheckConstraint("run_after IS NULL OR state = 'ready'", name="run_after"),
    sa.CheckConstraint("(finished_at IS NULL) = (state IN ('ready', 'leased'))", name="finished"),
    sa.CheckConstraint("state <> 'succeeded' OR stage = 'generate'", name="succeeded"),
    sa.CheckConstraint("seed >= 0", name="seed"),
    sa.UniqueConstraint("job_id", "position"),
    # Claim order: within a lane by position, solo items separate.
    sa.Index(
        "ix_item_ready",
        *("job_id", "queue", "batch_key", "solo", "position"),
        postgresql_where=sa.text("state = 'ready' AND run_after IS NULL"),
    ),
    sa.Index("ix_item_run_after", "run_after", postgresql_where=sa.text("run_after IS NOT NULL")),
    sa.Index("ix_item_lease_token", "lease_token", postgresql_where=sa.text("lease_token IS NOT NULL")),
    sa.Index("ix_item_text_key", "job_id", "text_key", postgresql_where=sa.text("state = 'ready' AND stage = 'text'")),
    sa.Index("ix_item_replaces", "replaces", unique=True, postgresql_where=sa.text("replaces IS NOT NULL")),
    # Search columns of succeeded items only: a submit has no overhead.
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

# Every motion that an edit is made from, with the sources of its sources. No foreign key to them: edits stay when a
# source is deleted, and a restored job may be older than its edits.
edited_from = sa.Table(
    "edited_from",
    metadata,
    sa.Column("item_id", Id, sa.ForeignKey("item.id", ondelete="CASCADE"), primary_key=True),
    sa.Column("source_id", Id, primary_key=True),
    sa.Index("ix_edited_from_source_id", "source_id"),
)

lane = sa.Table(
    "lane",
    metadata,
    sa.Column("job_id", Id, sa.ForeignKey("job.id", ondelete="CASCADE"), primary_key=True),
    sa.Column("queue", sa.Text, primary_key=True),
    sa.Column("batch_key", sa.Text, primary_key=True),
    sa.Column("ready", sa.Integer, nullable=False),  # claimable now, in batches
    sa.Column("solo", sa.Integer, nullable=False),  # claimable now, one at a time
    sa.Column("waiting_since", Time, nullable=False, server_default=NOW),  # last claim, or when it was last empty
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

# Verdicts of the encoder, by prompt, vocabulary and bundle; erased with the text features of the same prompt.
prompt_scope = sa.Table(
    "prompt_scope",
    metadata,
    sa.Column("key", sa.Text, primary_key=True),
    sa.Column("text_key", sa.Text, nullable=False, index=True),
    sa.Column("scope", JSONB, nullable=False),
    sa.Column("created_at", Time, nullable=False, server_default=NOW),
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
    # Checked at commit: the key is inserted first, so that a second submit waits for the first and writes nothing.
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
    sa.Column("announced_at", Time, nullable=False),  # time of the last announced upload
    sa.UniqueConstraint("tenant_id", "sha256"),
    sa.CheckConstraint("state IN ('writing', 'stored')", name="state"),
    sa.CheckConstraint("sha256 ~ '^[0-9a-f]{64}$'", name="sha256"),
    sa.Index("ix_asset_writing", "announced_at", postgresql_where=sa.text("state = 'writing'")),
    sa.Index("ix_asset_stored", "tenant_id", postgresql_include=["size"], postgresql_where=sa.text("state = 'stored'")),
)

# Leases that are writing an asset: two may produce the same content at once, and each protects it from the collector.
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
    sa.Column("review", sa.Text),  # null = not reviewed
    sa.Column("reviewed_at", Time),
    sa.Column("reviewed_by", sa.Text),  # name of an API key
    sa.Column("review_comment", sa.Text),
    sa.CheckConstraint(one_of("review", list(Review)), name="review"),
    sa.CheckConstraint("num_nulls(review, reviewed_at, reviewed_by) IN (0, 3)", name="reviewed"),
    sa.CheckConstraint("review IS NOT NULL OR review_comment IS NULL", name="review_comment"),
    sa.Index("ix_motion_tenant_id_id", "tenant_id", "id"),
    sa.Index("ix_motion_job_id_id", "job_id", "id"),
    sa.Index("ix_motion_review", "tenant_id", "review", "id", postgresql_where=sa.text("review IS NOT NULL")),
)

# Search and listing columns of motions, narrow and with indexes of their own. Triggers maintain them (migration 0014),
# so that writes of every release are covered. No foreign key: a trigger removes rows, many at a time. `terms` are the
# words of the prompt and, behind chr(1), all other filter values: `t` tenant, `j` job, `x` index of the prompt, `n`
# name in lower case, `g` tag, `r` review. One index intersects them all.
motion_search = sa.Table(
    "motion_search",
    metadata,
    sa.Column("motion_id", Id, primary_key=True),
    sa.Column("job_id", Id, nullable=False),
    sa.Column("created_at", Time, nullable=False),
    sa.Column("tenant_id", sa.Text, nullable=False),
    sa.Column("terms", TSVECTOR, nullable=False),
    sa.Index("ix_motion_search_created", "tenant_id", "created_at", "motion_id"),
    sa.Index("ix_motion_search_job", "job_id", "created_at", "motion_id"),
    # A search reads the whole pending list.
    sa.Index(
        "ix_motion_search_filters",
        "terms",
        sa.text("motion_name_prefixes(terms)"),
        postgresql_using="gin",
        postgresql_with={"gin_pending_list_limit": 512},
    ),
    sa.Index("ix_motion_search_short_id", "tenant_id", short_id("motion_id")),
)

motion_file = sa.Table(
    "motion_file",
    metadata,
    sa.Column("motion_id", Id, sa.ForeignKey("motion.id", ondelete="CASCADE"), primary_key=True),
    sa.Column("format", sa.Text, primary_key=True),
    sa.Column("asset_id", Id, sa.ForeignKey("asset.id"), nullable=False),
    # The file holds an erased prompt and waits to be rewritten; it is not served.
    sa.Column("erasing", sa.Boolean, nullable=False, server_default=sa.false()),
    sa.Index("ix_motion_file_asset_id", "asset_id"),
    sa.Index("ix_motion_file_erasing", "motion_id", postgresql_where=sa.text("erasing")),
)

# Rigs that motions are put on, by name. A new file or map under a name is a new version; files made on the version
# before it are removed.
rig = sa.Table(
    "rig",
    metadata,
    sa.Column("id", Id, primary_key=True),
    sa.Column("tenant_id", sa.Text, sa.ForeignKey("tenant.id"), nullable=False),
    sa.Column("name", sa.Text, nullable=False),
    sa.Column("version", sa.Integer, nullable=False, server_default="1"),
    sa.Column("format", sa.Text, nullable=False),  # ending of the file's name
    sa.Column("asset_id", Id, sa.ForeignKey("asset.id"), nullable=False),
    sa.Column("map", JSONB),  # parts and joints that its owner named; null = none
    sa.Column("report", JSONB, nullable=False),  # `marey.motion.rigs.report.describe`
    sa.Column("added_by", sa.Text, nullable=False),  # name of an API key
    sa.Column("created_at", Time, nullable=False, server_default=NOW),
    sa.Column("updated_at", Time, nullable=False, server_default=NOW),  # of the version
    sa.UniqueConstraint("tenant_id", "name"),
    sa.Index("ix_rig_asset_id", "asset_id"),
)

# Files that the API made of a motion's npz on request: a cache, which loses its oldest files. A row has an asset; or,
# until `expires_at`, the claim of the process that makes the file, or the reason why it cannot be made. A trigger
# (migration 0019) removes the rows of a motion whose prompt is erased.
made_file = sa.Table(
    "made_file",
    metadata,
    sa.Column("motion_id", Id, sa.ForeignKey("motion.id", ondelete="CASCADE"), primary_key=True),
    sa.Column("key", sa.Text, primary_key=True),  # `marey.exporters.making.FileRecipe.key`
    sa.Column("tenant_id", sa.Text, sa.ForeignKey("tenant.id"), nullable=False),
    sa.Column("format", sa.Text, nullable=False),
    # An earlier release, which does not know these references, may remove the asset as unused.
    sa.Column("asset_id", Id, sa.ForeignKey("asset.id", ondelete="CASCADE")),
    sa.Column("size", sa.BigInteger, nullable=False, server_default="0"),  # of the asset
    sa.Column("claim", Id),
    sa.Column("problem", JSONB),
    sa.Column("expires_at", Time),
    sa.Column("made_at", Time, nullable=False, server_default=NOW),
    sa.Column("rig_id", Id, sa.ForeignKey("rig.id", ondelete="CASCADE")),  # a rig of the tenant that it was made on
    sa.CheckConstraint("num_nonnulls(asset_id, claim, problem) = 1", name="state"),
    sa.CheckConstraint("(expires_at IS NULL) = (asset_id IS NOT NULL)", name="expires"),
    sa.Index("ix_made_file_asset_id", "asset_id", postgresql_where=sa.text("asset_id IS NOT NULL")),
    sa.Index(
        "ix_made_file_tenant_id",
        *("tenant_id", "made_at"),
        postgresql_include=["size"],
        postgresql_where=sa.text("asset_id IS NOT NULL"),
    ),
    sa.Index("ix_made_file_rig_id", "rig_id", postgresql_where=sa.text("rig_id IS NOT NULL")),
    sa.Index("ix_made_file_expires_at", "expires_at", postgresql_where=sa.text("expires_at IS NOT NULL")),
)
