"""Short references: the last digits of an id, a name, `last`, a motion's place in its job.

All readings of a reference are looked up, each by an index, within one tenant. Equal readings are one match;
otherwise all matches are returned and the caller reports the reference as ambiguous. No reading has precedence,
except a whole id, which has no other reading.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from enum import StrEnum
from typing import Any
from uuid import UUID

import sqlalchemy as sa

from marey.core.errors import InvalidInput
from marey.db.sql import among, check_text
from marey.db.tables import short_id
from marey.evaluations import tables as evaluation_tables
from marey.jobs import tables as job_tables
from marey.jobs.unmade import item_at, item_is, no_motion
from marey.streams import tables as stream_tables
from marey.takes.searching import motions_at
from marey.tenants import tables as tenant_tables
from marey.webhooks import tables as webhook_tables
from marey.webhooks.repository import get_webhook

LAST = "last"
SHORT = 8
"""Digits of a short id: the last of a UUIDv7, which are random; the first are shared by all ids of a batch."""
MOST = 10
"""Maximum number of returned matches."""
MAX_REFERENCE = 300
_DIGITS = re.compile(rf"[0-9a-f]{{{SHORT},31}}", re.IGNORECASE)
_WHOLE = re.compile(r"[0-9a-f]{8}-?([0-9a-f]{4}-?){3}[0-9a-f]{12}", re.IGNORECASE)
_PLACE = re.compile(r"(?P<job>.+):(?P<index>[0-9]{1,9})(\.(?P<variant>[0-9]{1,9}))?", re.DOTALL)


class ReferenceKind(StrEnum):
    """Kinds of objects that a reference may name."""

    JOB = "job"
    MOTION = "motion"
    STREAM = "stream"
    EVALUATION = "evaluation"
    SCHEDULE = "schedule"
    WEBHOOK = "webhook"
    DELIVERY = "delivery"
    KEY = "key"


@dataclass(frozen=True)
class ReferenceMatch:
    """A candidate of a reference."""

    kind: ReferenceKind
    id: UUID
    name: str | None
    created: datetime
    state: str | None = None
    items: int | None = None
    """Job of a motion."""
    job: UUID | None = None
    """Index of a motion in its job."""
    index: int | None = None
    variant: int | None = None


@dataclass(frozen=True)
class _Noun:
    """A table whose rows have ids of their own."""

    table: sa.Table
    state: str | None = None
    items: str | None = None


_NOUNS = {
    ReferenceKind.JOB: _Noun(job_tables.job, "state", "total"),
    ReferenceKind.STREAM: _Noun(stream_tables.stream, "state"),
    ReferenceKind.EVALUATION: _Noun(evaluation_tables.evaluation, "state"),
    ReferenceKind.SCHEDULE: _Noun(evaluation_tables.schedule),
    ReferenceKind.WEBHOOK: _Noun(webhook_tables.webhook),
    ReferenceKind.KEY: _Noun(tenant_tables.api_key),
}


def resolve_reference(
    conn: sa.Connection, tenant: str, kind: ReferenceKind, reference: str, *, webhook: UUID | None = None
) -> list[ReferenceMatch]:
    """Find the matches of a reference in a tenant, newest first: none, one, or up to `MOST` if it is ambiguous.

    Args:
        reference: a whole id; its last 8 to 31 digits; a name; `last` for the newest; of a motion also `JOB:INDEX` or
            `JOB:INDEX.VARIANT`, where JOB is any reference to a job.
        webhook: the webhook of a delivery; a delivery is named by its event.

    Raises:
        InvalidInput: not a reference, or a delivery without its webhook.
        NotFound: the tenant has no such webhook, or the reference names an item that has no motion; the error tells
            its state.
    """
    check_text(reference, "reference")
    if not 1 <= len(reference) <= MAX_REFERENCE:
        raise InvalidInput(f"a reference has 1 to {MAX_REFERENCE} characters", where="reference")
    if kind is ReferenceKind.MOTION:
        return _newest(_motions(conn, tenant, reference))
    if kind is ReferenceKind.DELIVERY:
        if webhook is None:
            raise InvalidInput("a delivery is one of a webhook", where="webhook", hint="Name the webhook too.")
        get_webhook(conn, tenant, webhook)
        return _newest(_deliveries(conn, webhook, reference))
    return _newest(_rows(conn, tenant, kind, reference))


def _newest(found: Sequence[ReferenceMatch]) -> list[ReferenceMatch]:
    """Sort newest first, without duplicates."""
    once = {match.id: match for match in found}
    return sorted(once.values(), key=lambda match: (match.created, match.id), reverse=True)[:MOST]


def _rows(conn: sa.Connection, tenant: str, kind: ReferenceKind, reference: str) -> list[ReferenceMatch]:
    noun = _NOUNS[kind]
    c = noun.table.c
    query = sa.select(
        *(c.id, c.name, c.created_at),
        c[noun.state] if noun.state else sa.null(),
        c[noun.items] if noun.items else sa.null(),
    ).where(c.tenant_id == tenant)
    readings = _by_id(reference, c.id)
    if not _WHOLE.fullmatch(reference):
        readings.append(c.name == reference)
    rows = _read(conn, query, readings, c.created_at, c.id, last=reference == LAST)
    return [ReferenceMatch(kind, *row) for row in rows]


def _read(
    conn: sa.Connection,
    query: sa.Select[*tuple[Any, ...]],
    readings: Sequence[sa.ColumnElement[bool]],
    created: sa.Column[Any],
    identifier: sa.Column[Any],
    *,
    last: bool,
) -> list[Sequence[Any]]:
    """Return the newest rows of each reading, and the newest of all for `last`."""
    rows: list[Sequence[Any]] = []
    for reading in readings:
        # Optimization fence: in creation order the planner would walk the whole listing for rare matches.
        fitting = query.where(reading).offset(0).subquery("fitting")
        newest = fitting.c[created.name].desc(), fitting.c[identifier.name].desc()
        rows += conn.execute(sa.select(fitting).order_by(*newest).limit(MOST)).all()
    if last:
        rows += conn.execute(query.order_by(created.desc(), identifier.desc()).limit(1)).all()
    return rows


def _by_id(reference: str, identifier: sa.Column[Any]) -> list[sa.ColumnElement[bool]]:
    """Return the condition of a whole id, or of its last digits."""
    if _WHOLE.fullmatch(reference):
        return [identifier == UUID(reference)]
    if not _DIGITS.fullmatch(reference):
        return []
    digits = reference.lower()
    ends = short_id(identifier.name) == digits[-SHORT:]
    if len(digits) > SHORT:
        whole = sa.func.replace(sa.cast(identifier, sa.Text), "-", "")
        ends &= sa.func.right(whole, len(digits)) == digits
    return [ends]


def _motions(conn: sa.Connection, tenant: str, reference: str) -> list[ReferenceMatch]:
    table = job_tables.motion_search.c
    query = sa.select(table.motion_id, table.created_at).where(table.tenant_id == tenant)
    readings = _by_id(reference, table.motion_id)
    ids = [row[0] for row in _read(conn, query, readings, table.created_at, table.motion_id, last=reference == LAST)]
    unmade = [item_is(UUID(reference))] if _WHOLE.fullmatch(reference) else []
    variant = None
    if place := _PLACE.fullmatch(reference):
        index, variant = int(place["index"]), None if place["variant"] is None else int(place["variant"])
        jobs = _newest(_rows(conn, tenant, ReferenceKind.JOB, place["job"]))
        if len(jobs) > 1:
            return jobs  # the intended one comes first
        ids += [motion for job in jobs for motion in motions_at(conn, job.id, index)]
        unmade += [item_at(job.id, index, variant) for job in jobs]
    motion, item = job_tables.motion.c, job_tables.item.c
    found = (
        sa.select(
            *(motion.id, item.name, motion.created_at, motion.review),
            *(motion.job_id.label("job"), item.index.label("place"), item.variant),
        )
        .join(job_tables.item, item.id == motion.item_id)
        .where(among(motion.id, ids), motion.tenant_id == tenant)
    )
    matches = [
        ReferenceMatch(ReferenceKind.MOTION, *row[:4], job=row.job, index=row.place, variant=row.variant)
        for row in conn.execute(found)
        if variant is None or row.variant == variant
    ]
    for wanted in () if matches else unmade:
        if (reason := no_motion(conn, tenant, wanted, where=f"motion {reference[:80]!r}")) is not None:
            raise reason
    return matches


def _deliveries(conn: sa.Connection, webhook: UUID, reference: str) -> list[ReferenceMatch]:
    c, event = webhook_tables.webhook_delivery.c, webhook_tables.webhook_event.c
    query = (
        sa.select(c.event_id, event.kind, c.created_at, c.state)
        .join(webhook_tables.webhook_event, event.id == c.event_id)
        .where(c.webhook_id == webhook)
    )
    readings = _by_id(reference, c.event_id)
    rows = _read(conn, query, readings, c.created_at, c.event_id, last=reference == LAST)
    return [ReferenceMatch(ReferenceKind.DELIVERY, *row) for row in rows]
