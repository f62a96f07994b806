"""Live streams."""

from __future__ import annotations

import sqlalchemy as sa
from sqlalchemy.dialects.postgresql import BYTEA, JSONB

from marey.db.tables import NOW, Id, Time, metadata, one_of, short_id
from marey.streams.states import StreamState

stream = sa.Table(
    "stream",
    metadata,
    sa.Column("id", Id, primary_key=True),
    sa.Column("tenant_id", sa.Text, sa.ForeignKey("tenant.id"), nullable=False),
    sa.Column("key_id", Id, sa.ForeignKey("api_key.id"), nullable=False),
    sa.Column("name", sa.Text),
    sa.Column("prompt", sa.Text, nullable=False),  # the first prompt; later ones are in chunks
    sa.Column("model", sa.Text, nullable=False),
    sa.Column("bundle", sa.Text, nullable=False),
    sa.Column("seed", sa.Integer, nullable=False),
    sa.Column("max_frames", sa.Integer, nullable=False),
    sa.Column("state", sa.Text, nullable=False, server_default="waiting"),
    sa.Column("reason", sa.Text),
    sa.Column("problem", JSONB),
    sa.Column("fence", sa.BigInteger, nullable=False, server_default="0"),  # number of the newest lease that wrote
    sa.Column("worker", sa.Text),
    sa.Column("control", sa.Text, nullable=False, server_default="0-0"),  # id of the last applied message
    sa.Column("frames", sa.Integer, nullable=False, server_default="0"),  # number of frames whose tokens are in chunks
    sa.Column("job_id", Id, sa.ForeignKey("job.id", ondelete="SET NULL")),  # job of the clip, once the stream has ended
    sa.Column("created_at", Time, nullable=False, server_default=NOW),
    sa.Column("started_at", Time),
    sa.Column("seen_at", Time, nullable=False, server_default=NOW),  # time of the worker's last write
    sa.Column("ended_at", Time),
    sa.CheckConstraint(one_of("state", list(StreamState)), name="state"),
    sa.CheckConstraint("(ended_at IS NULL) = (state IN ('waiting', 'live', 'paused'))", name="ended"),
    sa.CheckConstraint("seed >= 0", name="seed"),
    sa.CheckConstraint("frames >= 0 AND max_frames > 0", name="frames"),
    sa.Index("ix_stream_tenant_id_id", "tenant_id", "id"),
    sa.Index("ix_stream_created", "tenant_id", "created_at", "id"),
    sa.Index("ix_stream_short_id", "tenant_id", short_id()),
    sa.Index("ix_stream_name", "tenant_id", "name", postgresql_where=sa.text("name IS NOT NULL")),
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
    sa.Column("prompts", JSONB, nullable=False),  # prompts that came into force: [[frame, text], ...]
    sa.Column("reads", JSONB),  # their rewrites: [[rewritten, reason why not], ...]; NULL: not recorded
    sa.Column("acts", JSONB),  # action starts: [[frame, number in its prompt], ...]; NULL: not recorded
)
