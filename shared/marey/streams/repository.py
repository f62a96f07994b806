"""Live streams: rows with the state of each, and chunks of tokens from which it resumes after its worker died.

Redis decides which worker writes a stream (`marey.streams.redis`): a lease of 1.5 s with a fencing number. Every
write of a worker here names that number, and changes nothing once a newer lease has written.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any
from uuid import UUID

import sqlalchemy as sa
from sqlalchemy.dialects.postgresql import insert

from marey.core.errors import Busy, NotFound
from marey.db.ids import new_id
from marey.db.pages import PAGE, Order, Page
from marey.db.sql import CLOCK, check_text, interval, need_row
from marey.jobs import tables as job_tables
from marey.jobs.submit import submit
from marey.jobs.types import FailureReason, NewItem, NewJob
from marey.jobs.workers import has_loaded
from marey.streams import tables
from marey.streams.actions import ActionStart
from marey.streams.rewrites import PromptRewrite
from marey.streams.states import LIVE_QUEUE, OPEN_STREAMS, StreamState
from marey.streams.types import NewStream, StreamChunk, StreamPast, StreamPrompt, StreamRow
from marey.tenants import tables as tenant_tables
from marey.tenants.repository import get_tenant
from marey.webhooks.outbox import enqueue_event
from marey.webhooks.types import EventKind

OPEN = tuple(str(state) for state in OPEN_STREAMS)
RETRY_SECONDS = 10
"""Retry delay above the limit: a slot is freed when one of the caller's own streams ends."""


def create_stream(conn: sa.Connection, stream: NewStream, *, limit: int) -> UUID:
    """Create a stream that waits for a worker.

    Args:
        limit: maximum of open streams per API key, if its tenant has no quota.

    Raises:
        Busy: the key has reached its limit.
        InvalidInput: text that the database cannot hold.
    """
    check_text(stream.prompt, "prompt")
    check_text(stream.name, "name")
    table = tables.stream
    # The key's row is the lock: concurrent requests count one after the other.
    conn.execute(
        sa.select(tenant_tables.api_key.c.id).where(tenant_tables.api_key.c.id == stream.key).with_for_update()
    )
    own = get_tenant(conn, stream.tenant).quotas.streams
    limit = limit if own is None else own
    mine = sa.select(sa.func.count()).where(table.c.key_id == stream.key, table.c.ended_at.is_(None))
    if conn.execute(mine).scalar_one() >= limit:
        raise Busy(
            f"this key has {limit} live streams, which is its limit",
            hint="End one of them, or try again later.",
            seconds=RETRY_SECONDS,
        )
    identifier = new_id()
    conn.execute(
        sa.insert(table).values(
            id=identifier,
            tenant_id=stream.tenant,
            key_id=stream.key,
            name=stream.name,
            prompt=stream.prompt,
            model=stream.model,
            bundle=stream.bundle,
            seed=stream.seed,
            max_frames=stream.max_frames,
        )
    )
    return identifier


def get_stream(conn: sa.Connection, tenant: str, stream: UUID) -> StreamRow:
    """Return one stream.

    Raises:
        NotFound: the tenant has no such stream.
    """
    table = tables.stream.c
    query = _streams().where(table.tenant_id == tenant, table.id == stream)
    return _row(need_row(conn, query, NotFound("there is no such stream", where=f"stream {stream}")))


def list_streams(
    conn: sa.Connection, tenant: str, *, is_open: bool = False, cursor: str | None = None, limit: int = PAGE
) -> Page[StreamRow]:
    """Return streams, newest first; with `is_open` only open ones."""
    table = tables.stream.c
    ours = table.tenant_id == tenant
    query, order = _streams().where(ours), Order(table.created_at, table.id)
    if is_open:
        query = query.where(table.ended_at.is_(None))
    return order.page(conn, query, ours, cursor, limit, _row)


def stream_prompts(conn: sa.Connection, stream: UUID) -> list[tuple[int, str]]:
    """Return every recorded prompt of a stream, with its first frame."""
    table = tables.stream_chunk.c
    query = sa.select(table.prompts).where(table.stream_id == stream).order_by(table.first)
    return [(int(frame), str(text)) for prompts in conn.execute(query).scalars() for frame, text in prompts]


def prompts_with_rewrites(conn: sa.Connection, stream: UUID) -> list[StreamPrompt]:
    """Return `stream_prompts`, each with its rewrite."""
    table = tables.stream_chunk.c
    query = sa.select(table.prompts, table.reads).where(table.stream_id == stream).order_by(table.first)
    return [
        StreamPrompt(int(frame), str(text), None if reads is None else PromptRewrite(*reads[number]))
        for prompts, reads in conn.execute(query)
        for number, (frame, text) in enumerate(prompts)
    ]


def stream_actions(conn: sa.Connection, stream: UUID) -> list[ActionStart]:
    """Return every recorded action start of a stream; none from workers that did not record actions."""
    table = tables.stream_chunk.c
    query = sa.select(table.acts).where(table.stream_id == stream, table.acts.is_not(None)).order_by(table.first)
    return [ActionStart(*action) for actions in conn.execute(query).scalars() for action in actions]


# --- functions for workers ---


def open_streams(conn: sa.Connection, bundle: str, limit: int = 200) -> list[StreamRow]:
    """Return the open streams of a bundle, oldest first: waiting ones, and those that a worker has or had (the lease on
    Redis tells which). Waiting streams of suspended tenants are left out."""
    table, tenant = tables.stream.c, tenant_tables.tenant.c
    idle = sa.exists().where(tenant.id == table.tenant_id, tenant.suspended_at.is_not(None))
    wanted = (table.bundle == bundle) & table.ended_at.is_(None) & ((table.state != StreamState.WAITING) | ~idle)
    query = _streams().where(wanted).order_by(table.created_at, table.id).limit(limit)
    return [_row(row) for row in conn.execute(query).mappings()]


def take_stream(conn: sa.Connection, stream: UUID, fence: int, worker: str) -> StreamPast | None:
    """Put a stream under the lease `fence` and read its past; None if the stream has ended or a newer lease exists."""
    table = tables.stream
    taken = conn.execute(
        sa.update(table)
        .where(table.c.id == stream, table.c.fence < fence, table.c.state.in_(OPEN))
        .values(
            fence=fence,
            worker=worker,
            state=sa.case((table.c.state == StreamState.WAITING, StreamState.LIVE), else_=table.c.state),
            started_at=sa.func.coalesce(table.c.started_at, CLOCK),
            seen_at=CLOCK,
        )
        .returning(table.c.id)
    ).one_or_none()
    if taken is None:
        return None
    row = _row(conn.execute(_streams().where(table.c.id == stream)).mappings().one())
    chunk = tables.stream_chunk.c
    tokens = conn.execute(sa.select(chunk.tokens).where(chunk.stream_id == stream).order_by(chunk.first)).scalars()
    return StreamPast(row, b"".join(tokens), tuple(stream_prompts(conn, stream)), tuple(stream_actions(conn, stream)))


def add_chunk(conn: sa.Connection, stream: UUID, fence: int, chunk: StreamChunk) -> bool:
    """Record the frames since the last chunk and the stream's state; return False if a newer lease exists or the stream
    has ended. A chunk without frames is a sign of life."""
    table = tables.stream
    values: dict[str, Any] = {"seen_at": CLOCK, "control": chunk.control, "frames": chunk.first + chunk.frames}
    if chunk.state is not None:
        values["state"] = chunk.state
    ours = (table.c.id == stream) & (table.c.fence == fence) & table.c.state.in_(OPEN)
    if conn.execute(sa.update(table).where(ours, table.c.frames == chunk.first).values(values)).rowcount == 0:
        return False
    if chunk.frames:
        conn.execute(
            sa.insert(tables.stream_chunk).values(
                stream_id=stream,
                first=chunk.first,
                tokens=chunk.tokens,
                prompts=[[frame, text] for frame, text in chunk.prompts],
                acts=[list(action) for action in chunk.actions],
                reads=sa.null() if chunk.reads is None else [list(read) for read in chunk.reads],
            )
        )
    return True


def end_stream(
    conn: sa.Connection,
    stream: UUID,
    fence: int | None,
    reason: str,
    *,
    problem: FailureReason | None = None,
    clip: tuple[NewItem, bytes] | None = None,
) -> bool:
    """End a stream; its clip, if it has one, becomes a job of one item.

    Args:
        fence: number of the worker's lease; None = no worker holds it (the scheduler).
        problem: reason of a failure.
        clip: the item, and the recording that its `text_key` names.

    Returns:
        False if it had ended before, or a newer lease exists.
    """
    table = tables.stream
    ours = (table.c.id == stream) & table.c.state.in_(OPEN)
    if fence is not None:
        ours &= table.c.fence == fence
    asked = sa.select(table.c.tenant_id, table.c.name, table.c.frames).where(ours)
    row = conn.execute(asked.with_for_update()).one_or_none()
    if row is None:
        return False
    job = None
    if clip is not None:
        item, blob = clip
        texts = insert(job_tables.text_features).values(key=item.text_key, blob=blob)
        conn.execute(texts.on_conflict_do_nothing())
        job = submit(conn, _clip_job(stream, row.tenant_id, row.name, item)).id
    state = StreamState.ENDED if problem is None else StreamState.FAILED
    values = {
        "state": state,
        "reason": reason,
        "problem": None if problem is None else asdict(problem),
        "job_id": job,
        "ended_at": CLOCK,
        "seen_at": CLOCK,
    }
    conn.execute(sa.update(table).where(table.c.id == stream).values(values))
    enqueue_stream_event(conn, row.tenant_id, stream, state, frames=row.frames, job=job)
    return True


def abandoned_streams(conn: sa.Connection, seconds: float) -> Sequence[UUID]:
    """Return open streams without a write for the given time."""
    table = tables.stream.c
    query = sa.select(table.id).where(table.ended_at.is_(None), table.seen_at < CLOCK - interval(seconds))
    return list(conn.execute(query.order_by(table.id)).scalars())


# --- helpers ---


def _clip_job(stream: UUID, tenant: str, name: str | None, item: NewItem) -> NewJob:
    return NewJob([item], tenant=tenant, name=name, comment=f"clip of stream {stream}", metered=False)


def _streams() -> sa.Select[*tuple[Any, ...]]:
    table, earlier = tables.stream, tables.stream.alias("earlier")
    before = (
        sa.select(sa.func.count())
        .where(earlier.c.bundle == table.c.bundle, earlier.c.state == StreamState.WAITING, earlier.c.id < table.c.id)
        .scalar_subquery()
    )
    c = table.c
    waits_for = sa.case((has_loaded(c.bundle, LIVE_QUEUE), "slot"), else_="worker")
    return sa.select(
        *(c.id, c.tenant_id.label("tenant"), c.name, c.prompt, c.model, c.bundle, c.seed, c.max_frames),
        *(c.state, c.reason, c.problem, c.fence, c.worker, c.control, c.frames, c.job_id.label("job")),
        *(c.created_at.label("created"), c.started_at.label("started"), c.ended_at.label("ended")),
        sa.case((c.state == StreamState.WAITING, before), else_=None).label("position"),
        sa.case((c.state == StreamState.WAITING, waits_for), else_=None).label("waits_for"),
    )


def _row(row: sa.RowMapping) -> StreamRow:
    values: dict[str, Any] = dict(row)
    values["state"] = StreamState(row["state"])
    values["problem"] = None if row["problem"] is None else FailureReason(**row["problem"])
    return StreamRow(**values)


def enqueue_stream_event(
    conn: sa.Connection, tenant: str, stream: UUID, state: StreamState, *, frames: int, job: UUID | None
) -> None:
    """Enqueue a webhook event for a stream that ended; `job` makes its clip."""
    data = {"stream": stream, "state": state, "counters": {"frames": frames}, "job": job}
    enqueue_event(conn, tenant, EventKind.STREAM_ENDED, data)
