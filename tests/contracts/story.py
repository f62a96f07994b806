"""A story in which every kind of event happens once, and what clients are told of it."""

from __future__ import annotations

import json
from collections import defaultdict
from typing import Any
from uuid import UUID, uuid4

import sqlalchemy as sa

from marey.api.jobs.events import message
from marey.db import transaction
from marey.evaluations import EvaluationState
from marey.evaluations.repository import enqueue_evaluation_event
from marey.jobs import (
    EventRow,
    ItemFailure,
    Review,
    cancel,
    claim,
    events_after,
    fail_items,
    pause,
    release,
    resume,
    retry,
    set_comment,
    set_fail_early,
    set_priority,
    sweep,
)
from marey.streams import StreamState
from marey.streams.repository import enqueue_stream_event
from marey.takes import erase, list_motions, reroll, review
from marey.tenants import DEFAULT_TENANT
from marey.webhooks import EventKind, claim_deliveries
from marey.webhooks.message import headers_of, message_of
from tests.servers.jobs import PROBLEM, claim_some, commit_all, let_expire, new_item, parse_texts, submit_items
from tests.support.webhooks import SECRET, new_webhook


def events(engine: sa.Engine) -> Any:
    """By kind: fields of the data of job events, of webhook messages, and names of their headers."""
    new_webhook(engine)
    jobs = [_worked(engine), _operated(engine)]
    with transaction(engine) as conn:
        stream = uuid4()
        enqueue_stream_event(conn, DEFAULT_TENANT, stream, StreamState.ENDED, frames=20, job=jobs[0])
        enqueue_evaluation_event(conn, DEFAULT_TENANT, uuid4(), EvaluationState.DONE, schedule=uuid4(), regressed=True)
        rows = [event for job in jobs for event in events_after(conn, DEFAULT_TENANT, job)]
    with transaction(engine) as conn:
        due = claim_deliveries(conn, 100, each=100)
    bodies = {each.kind: json.loads(message_of(each, "https://marey.example.com")) for each in due}
    headers = sorted(headers_of(due[0], b"{}", [SECRET]))
    assert set(bodies) == {str(kind) for kind in EventKind}
    return {
        "job_events": _by_kind(rows),
        "server_sent": sorted(line.partition(b":")[0].decode() for line in message(rows[0]).splitlines() if line),
        "webhooks": {kind: _shape(body) for kind, body in sorted(bodies.items())},
        "webhook_headers": headers,
    }


def _worked(engine: sa.Engine) -> UUID:
    """A job of which items succeed, fail, are released, lost, retried, reviewed, drawn again and erased."""
    job = submit_items(engine, 6)
    parse_texts(engine)
    held = claim_some(engine, limit=2)
    with transaction(engine) as conn:
        fail_items(conn, held.lease_token, [ItemFailure(held.items[0].id, PROBLEM, retryable=False)])
        release(conn, held.lease_token, "the store is away")
    lost = claim_some(engine, limit=1)
    let_expire(engine, lost.lease_token)
    sweep(engine)
    _run_all(engine)
    with transaction(engine) as conn:
        retry(conn, DEFAULT_TENANT, job)
    _run_all(engine)
    with transaction(engine) as conn:
        motion = list_motions(conn, DEFAULT_TENANT, job=job).rows[0].id
        review(conn, DEFAULT_TENANT, [motion], Review.KEPT, by="tester", comment="clean feet")
        reroll(conn, DEFAULT_TENANT, [motion], lambda item: new_item(item.index, item.prompt), by="tester")
    _run_all(engine)
    with transaction(engine) as conn:
        erase(conn, DEFAULT_TENANT, job, by="tester")
    return job


def _operated(engine: sa.Engine) -> UUID:
    """A job that an operator steers and cancels."""
    job = submit_items(engine, 2)
    with transaction(engine) as conn:
        pause(conn, DEFAULT_TENANT, job)
        resume(conn, DEFAULT_TENANT, job)
        set_priority(conn, DEFAULT_TENANT, job, 3)
        set_fail_early(conn, DEFAULT_TENANT, job, 0.5)
        set_comment(conn, DEFAULT_TENANT, job, "for shot 10")
        cancel(conn, DEFAULT_TENANT, job)
    return job


def _run_all(engine: sa.Engine) -> None:
    parse_texts(engine)
    while True:
        with transaction(engine) as conn:
            found = claim(conn, "hgm3", "w", 32)
        if found is None:
            return
        commit_all(engine, found)


def _by_kind(rows: list[EventRow]) -> dict[str, list[str]]:
    fields: dict[str, set[str]] = defaultdict(set)
    for row in rows:
        fields[row.kind] |= set(_shape(row.data))
    return {kind: sorted(names) for kind, names in sorted(fields.items())}


def _shape(value: Any, prefix: str = "") -> list[str]:
    """Dotted names of the fields of an object, each with the kind of its value."""
    found: list[str] = []
    for name, each in sorted(value.items()):
        if isinstance(each, dict):
            found += _shape(each, f"{prefix}{name}.")
        else:
            found.append(f"{prefix}{name}: {type(each).__name__}")
    return found
