"""Evaluations and their schedules."""

from __future__ import annotations

import sqlalchemy as sa
from sqlalchemy.dialects.postgresql import JSONB

from marey.db.tables import NOW, Id, Time, metadata, one_of, short_id
from marey.evaluations.states import EvaluationState

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
    sa.Column("request", JSONB, nullable=False),  # names as given: each run resolves the exact bundles
    sa.Column("prompts_sha256", sa.Text),  # null = those of the evaluator's bundle
    sa.Column("paused", sa.Boolean, nullable=False, server_default=sa.false()),
    sa.Column("next_at", Time, nullable=False),  # without meaning while paused
    sa.Column("created_at", Time, nullable=False, server_default=NOW),
    sa.ForeignKeyConstraint(
        ["tenant_id", "prompts_sha256"],
        ["prompt_set.tenant_id", "prompt_set.sha256"],
        name="fk_schedule_prompts",
    ),
    sa.Index("ix_schedule_tenant_id_id", "tenant_id", "id"),
    sa.Index("ix_schedule_created", "tenant_id", "created_at", "id"),
    sa.Index("ix_schedule_short_id", "tenant_id", short_id()),
    sa.Index("ix_schedule_next_at", "next_at", postgresql_where=sa.text("NOT paused")),
)

evaluation = sa.Table(
    "evaluation",
    metadata,
    sa.Column("id", Id, primary_key=True),
    sa.Column("tenant_id", sa.Text, sa.ForeignKey("tenant.id"), nullable=False),
    sa.Column("schedule_id", Id, sa.ForeignKey("schedule.id", ondelete="SET NULL")),
    sa.Column("due_at", Time),  # due time of its schedule; null = requested directly
    sa.Column("name", sa.Text),
    sa.Column("comment", sa.Text),
    sa.Column("request", JSONB, nullable=False),  # exact once it is generating
    sa.Column("prompts_sha256", sa.Text),  # known once it is generating
    sa.Column("state", sa.Text, nullable=False, server_default="planned"),
    sa.Column("reason", sa.Text, nullable=False),  # reason of this state
    sa.Column("generate_job_id", Id, sa.ForeignKey("job.id", ondelete="SET NULL")),
    sa.Column("score_job_id", Id, sa.ForeignKey("job.id", ondelete="SET NULL")),
    sa.Column("summary", JSONB),
    sa.Column("regressed", sa.Boolean),  # null = there was no baseline
    sa.Column("created_at", Time, nullable=False, server_default=NOW),
    sa.Column("started_at", Time),
    sa.Column("finished_at", Time),
    sa.ForeignKeyConstraint(
        ["tenant_id", "prompts_sha256"],
        ["prompt_set.tenant_id", "prompt_set.sha256"],
        name="fk_evaluation_prompts",
    ),
    sa.CheckConstraint(one_of("state", list(EvaluationState)), name="state"),
    sa.CheckConstraint("(finished_at IS NULL) = (state IN ('planned', 'generating', 'scoring'))", name="finished"),
    sa.CheckConstraint("(state = 'done') = (summary IS NOT NULL)", name="summary"),
    sa.CheckConstraint("regressed IS NULL OR state = 'done'", name="regressed"),
    sa.CheckConstraint("state NOT IN ('generating', 'scoring', 'done') OR prompts_sha256 IS NOT NULL", name="prompts"),
    sa.UniqueConstraint("schedule_id", "due_at"),
    sa.Index("ix_evaluation_tenant_id_id", "tenant_id", "id"),
    sa.Index("ix_evaluation_created", "tenant_id", "created_at", "id"),
    sa.Index("ix_evaluation_short_id", "tenant_id", short_id()),
    sa.Index("ix_evaluation_name", "tenant_id", "name", postgresql_where=sa.text("name IS NOT NULL")),
    sa.Index("ix_evaluation_schedule_id_id", "schedule_id", "id"),
    sa.Index("ix_evaluation_schedule_created", "schedule_id", "created_at", "id"),
    sa.Index("ix_evaluation_open", "id", postgresql_where=sa.text("finished_at IS NULL")),
    # Baseline of the next run: the last one of the same prompts.
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
