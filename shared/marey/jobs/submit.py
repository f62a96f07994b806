"""Submission: job, items, lanes, event and idempotency row in one transaction."""

from __future__ import annotations

import itertools
import json
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from operator import attrgetter
from typing import cast
from uuid import UUID

import psycopg
import sqlalchemy as sa
from psycopg import sql

from marey.core.errors import InvalidInput
from marey.db.ids import new_id
from marey.db.sql import among, check_text
from marey.items.item import JSON_FIELDS, SPEC_FIELDS
from marey.jobs import tables
from marey.jobs.idempotency import find_key, take_key
from marey.jobs.journal import Lane, LaneChange, NewEvent, change_lanes, lock_job, record
from marey.jobs.states import ItemStage, JobState
from marey.jobs.types import (
    MAX_KEEP_DAYS,
    NO_TEXT,
    PRIORITY_LIMIT,
    SEED_LIMIT,
    TEXT_QUEUE,
    JsonObject,
    NewItem,
    NewJob,
    SubmittedJob,
)
from marey.tenants.quotas import check_queue, reserve_quotas
from marey.vocabulary.scope import ScopePolicy

CHUNK = 2000  # items per COPY chunk, and keys per look-up

TEXTS_LOCK = 0x6D617265
"""Advisory lock: shared by transactions that rely on existing text features, exclusive for those that delete some."""

COLUMNS = (
    *("id", "job_id", "position", "index", "variant", "model", "bundle", "seed", "settings", "text_key"),
    *("generate_batch_key", "stage", "queue", "batch_key", "replaces", "scope", "edits"),
    *SPEC_FIELDS,
)
_spec: Callable[[NewItem], tuple[object, ...]] = attrgetter(*SPEC_FIELDS)
_OF_JSON = tuple(name in JSON_FIELDS for name in SPEC_FIELDS)
COPY = sql.SQL("COPY item ({}) FROM STDIN").format(sql.SQL(", ").join(map(sql.Identifier, COLUMNS)))


def submit(conn: sa.Connection, job: NewJob) -> SubmittedJob:
    """Write a job and its items; the relay is notified when the transaction commits.

    Items with known text features skip the text stage, unless its encoder has to decide their scope. With an
    idempotency key, a second submit of the same body within 24 hours returns the first one's job, `replayed`.

    Raises:
        InvalidInput: no items, or a value out of its range; nothing is written (roll the transaction back).
        QuotaUsedUp: the tenant's quotas do not allow it; nothing is written.
        IdempotencyMismatch: the key was used with another body.
    """
    _check_values(job)
    identifier = new_id()
    earlier = _earlier(conn, job, identifier)
    if earlier is not None:
        return earlier
    if job.metered:
        check_queue(conn, job.tenant, job.count or 1)
    conn.execute(
        sa.insert(tables.job).values(
            id=identifier,
            tenant_id=job.tenant,
            name=job.name,
            comment=job.comment,
            priority=job.priority,
            fail_early=job.fail_early,
            keep_days=job.keep_days,
            traceparent=job.traceparent,
            scope=job.scope,
            kind=job.kind,
        )
    )
    lanes = write_items(conn, identifier, job.items, scope=job.scope)
    total = sum(lanes.values())
    if total == 0:
        raise InvalidInput("there is nothing to submit", where="items")
    if job.metered:
        reserve_quotas(conn, job.tenant, total)  # last: other transactions of the tenant wait from here to the commit
    _begin(conn, identifier, total)
    change_lanes(conn, identifier, {lane: LaneChange(ready=count) for lane, count in lanes.items()})
    return SubmittedJob(identifier, replayed=False, items=total)


def _check_values(job: NewJob) -> None:
    """Check what a job says of itself, apart from its items.

    Raises:
        InvalidInput: a number out of its range, or text that the database cannot hold.
    """
    if not -PRIORITY_LIMIT <= job.priority <= PRIORITY_LIMIT:
        raise InvalidInput(f"{job.priority} is not between -{PRIORITY_LIMIT} and {PRIORITY_LIMIT}", where="priority")
    check_share(job.fail_early)
    if job.keep_days is not None and not 1 <= job.keep_days <= MAX_KEEP_DAYS:
        raise InvalidInput(f"{job.keep_days} is not between 1 and {MAX_KEEP_DAYS} days", where="keep_days")
    for where, text in (("name", job.name), ("comment", job.comment), ("idempotency key", job.idempotency_key)):
        check_text(text, where)


def _begin(conn: sa.Connection, identifier: UUID, total: int) -> None:
    conn.execute(sa.update(tables.job).where(tables.job.c.id == identifier).values(total=total, ready=total))
    locked = lock_job(conn, identifier)
    assert locked is not None
    record(conn, locked, [NewEvent("submitted", f"submitted with {total} items", data={"to": JobState.QUEUED})])


def _earlier(conn: sa.Connection, job: NewJob, identifier: UUID) -> SubmittedJob | None:
    """Register the idempotency key for this job, or return the job that has it."""
    made = take_key(conn, job.tenant, job.idempotency_key, job.body_sha256, "job_id", identifier)
    return None if made is None else _replayed(conn, made)


def find_submitted(conn: sa.Connection, tenant: str, key: str | None, body_sha256: str | None) -> SubmittedJob | None:
    """Return the job of an earlier submit with an idempotency key; None = there is none, or no key.

    Raises:
        IdempotencyMismatch: the key was used with another body.
    """
    made = find_key(conn, tenant, key, body_sha256, "job_id")
    return None if made is None else _replayed(conn, made)


def _replayed(conn: sa.Connection, made: UUID) -> SubmittedJob:
    total = conn.execute(sa.select(tables.job.c.total).where(tables.job.c.id == made)).scalar_one()
    return SubmittedJob(made, replayed=True, items=total)


def write_items(
    conn: sa.Connection, job: UUID, items: Iterable[NewItem], *, first: int = 0, scope: ScopePolicy = "ignore"
) -> Counter[Lane]:
    """COPY the items in chunks, with positions from `first` on; return the size of each lane. The caller updates
    counters and lanes.

    Args:
        scope: policy of the job; the text stage refuses what its encoder finds unknown, known verdicts or not.
    """
    conn.execute(sa.select(sa.func.pg_advisory_xact_lock_shared(TEXTS_LOCK)))
    lanes: Counter[Lane] = Counter()
    connection = cast("psycopg.Connection", conn.connection.driver_connection)
    positions = itertools.count(first)
    for chunk in _chunks(items):
        known = _known_texts(conn, {item.text_key for item in chunk}) | {NO_TEXT}
        scopes = _known_scopes(conn, {item.scope_key for item in chunk if item.scope_key is not None}, scope)
        with connection.cursor() as cursor, cursor.copy(COPY) as copy:
            for item, position in zip(chunk, positions, strict=False):
                _check_item(item)
                ready = item.text_key in known
                if item.scope_key is not None:
                    verdict = scopes.get(item.scope_key)
                    ready = ready and verdict is not None
                    item = replace(item, scope=verdict or item.scope)
                stage = ItemStage.GENERATE if ready else ItemStage.TEXT
                lane = (TEXT_QUEUE, item.text_batch_key) if stage is ItemStage.TEXT else (item.model, item.batch_key)
                lanes[lane] += 1
                copy.write_row(_row(item, job, position, stage, lane))
    return lanes


def _chunks(items: Iterable[NewItem]) -> Iterator[list[NewItem]]:
    source = iter(items)
    while chunk := list(itertools.islice(source, CHUNK)):
        yield chunk


def _as_column(value: object, of_json: bool) -> object:
    if of_json:
        return None if value is None else json.dumps(value)
    return list(cast("tuple[object, ...]", value)) if isinstance(value, tuple) else value


def _row(item: NewItem, job: UUID, position: int, stage: ItemStage, lane: Lane) -> tuple[object, ...]:
    return (
        *(new_id(), job, position, item.index, item.variant, item.model, item.bundle, item.seed),
        *(json.dumps(dict(item.settings)), item.text_key, item.batch_key, str(stage), *lane, item.replaces),
        None if item.scope is None else json.dumps(dict(item.scope)),
        None if item.edits is None else json.dumps(item.edits.as_json()),
        *map(_as_column, _spec(item), _OF_JSON),
    )


def _known_texts(conn: sa.Connection, keys: set[str]) -> set[str]:
    table = tables.text_features.c
    return set(conn.execute(sa.select(table.key).where(among(table.key, keys))).scalars())


def _known_scopes(conn: sa.Connection, keys: set[str], policy: ScopePolicy) -> dict[str, JsonObject]:
    """Return verdicts of earlier text stages by their keys; under `refuse` without those that it refuses."""
    table = tables.prompt_scope.c
    query = sa.select(table.key, table.scope).where(among(table.key, keys))
    found = {row.key: row.scope for row in conn.execute(query)} if keys else {}
    return {key: scope for key, scope in found.items() if policy != "refuse" or scope["verdict"] != "unknown"}


def _check_item(item: NewItem) -> None:
    where = f"items.{item.index}"
    check_text(item.prompt, f"{where}.prompt")
    check_text(item.name, f"{where}.name")
    for tag in item.tags:
        check_text(tag, f"{where}.tags")
    if not 0 <= item.seed < SEED_LIMIT:
        raise InvalidInput(f"{item.seed} is not a seed: 0 … {SEED_LIMIT - 1}", where=f"{where}.seed")


def check_share(share: float | None) -> None:
    """Validate a failure ratio for `fail_early`; None = off.

    Raises:
        InvalidInput: not between 0 and 1.
    """
    if share is not None and not 0 <= share <= 1:
        raise InvalidInput(f"{share} is not a share between 0 and 1", where="fail_early", hint="0.1 is one in ten.")
