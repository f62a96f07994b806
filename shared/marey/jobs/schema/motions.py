"""Motions, and the stored files of everything."""

from __future__ import annotations

import sqlalchemy as sa
from sqlalchemy.dialects.postgresql import JSONB, TSVECTOR

from marey.jobs.schema.base import NOW, Id, Time, metadata, one_of, short_id
from marey.jobs.states import Review

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
    sa.CheckConstraint(one_of("review", list(Review)), name="review"),
    sa.CheckConstraint("num_nulls(review, reviewed_at, reviewed_by) IN (0, 3)", name="reviewed"),
    sa.CheckConstraint("review IS NOT NULL OR review_comment IS NULL", name="review_comment"),
    sa.Index("ix_motion_tenant_id_id", "tenant_id", "id"),
    sa.Index("ix_motion_job_id_id", "job_id", "id"),
    sa.Index("ix_motion_review", "tenant_id", "review", "id", postgresql_where=sa.text("review IS NOT NULL")),
)

# What motions are listed and searched by, narrow and with indexes of its own. Triggers keep it (migration 0014), so
# that the writes of every release reach it. No foreign key: a trigger removes rows, many at a time.
# `terms` are the words of the prompt and, behind chr(1), everything else that a filter names: `t` tenant, `j` job, `x`
# index of the prompt, `n` name in lower case, `g` tag, `r` review. One index intersects them all.
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
    # A search reads what is pending through to its end.
    sa.Index(
        "ix_motion_search_terms", "terms", postgresql_using="gin", postgresql_with={"gin_pending_list_limit": 512}
    ),
    sa.Index("ix_motion_search_short_id", "tenant_id", short_id("motion_id")),
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
