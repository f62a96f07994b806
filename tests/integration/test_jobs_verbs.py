"""Every verb of an operator on a job in every state: what becomes of it, and what its events tell."""

from __future__ import annotations

from collections.abc import Callable
from uuid import UUID

import sqlalchemy as sa

from marey.core.errors import Conflict, NotFound
from marey.db import transaction
from marey.jobs import (
    ItemFailure,
    JobRow,
    JobState,
    cancel,
    events_after,
    fail_items,
    get_job,
    pause,
    resume,
    retry,
    set_comment,
    set_fail_early,
    set_priority,
    tables,
)
from marey.takes import delete
from tests.servers.audit import audit
from tests.servers.jobs import PROBLEM, claim_some, commit_all, new_item, submit_items

S = JobState
REASON = "because"
Verb = Callable[[sa.Connection, UUID], JobRow | None]
VERBS: dict[str, Verb] = {
    "pause": lambda conn, job: pause(conn, "default", job, REASON),
    "resume": lambda conn, job: resume(conn, "default", job, REASON),
    "cancel": lambda conn, job: cancel(conn, "default", job, REASON),
    "retry": lambda conn, job: retry(conn, "default", job, reason=REASON),
    "retry failed": lambda conn, job: retry(conn, "default", job, failed_only=True, reason=REASON),
    "priority": lambda conn, job: set_priority(conn, "default", job, 7, REASON),
    "fail early": lambda conn, job: set_fail_early(conn, "default", job, 0.5, REASON),
    "comment": lambda conn, job: set_comment(conn, "default", job, REASON),
    "delete": lambda conn, job: delete(conn, "default", job),
}
GONE, REFUSED = "gone", "refused"
ALWAYS = {
    "priority": f"priority 7: {REASON}",
    "comment": REASON,
    "fail early": f"fails early above a share of 0.5: {REASON}",
}
"""Verbs that are always allowed and change no state, and what their events tell."""

# What a verb makes of a job in a state. Each job has one item that failed, but for those that cannot.
OUTCOMES: dict[JobState, dict[str, JobState | str]] = {
    S.QUEUED: {
        "pause": S.PAUSED, "resume": S.QUEUED, "cancel": S.CANCELLED, "retry": REFUSED, "retry failed": REFUSED,
        "delete": REFUSED,
    },
    S.RUNNING: {
        "pause": S.PAUSED, "resume": S.RUNNING, "cancel": S.CANCELLED, "retry": S.RUNNING, "retry failed": S.RUNNING,
        "delete": REFUSED,
    },
    S.PAUSED: {
        "pause": S.PAUSED, "resume": S.RUNNING, "cancel": S.CANCELLED, "retry": S.PAUSED, "retry failed": S.PAUSED,
        "delete": REFUSED,
    },
    S.SUCCEEDED: {
        "pause": REFUSED, "resume": REFUSED, "cancel": S.SUCCEEDED, "retry": REFUSED, "retry failed": REFUSED,
        "delete": GONE,
    },
    S.PARTIAL: {
        "pause": REFUSED, "resume": REFUSED, "cancel": S.PARTIAL, "retry": S.RUNNING, "retry failed": S.RUNNING,
        "delete": GONE,
    },
    S.FAILED: {
        "pause": REFUSED, "resume": REFUSED, "cancel": S.FAILED, "retry": S.RUNNING, "retry failed": S.RUNNING,
        "delete": GONE,
    },
    S.CANCELLED: {
        "pause": REFUSED, "resume": REFUSED, "cancel": S.CANCELLED, "retry": S.RUNNING, "retry failed": S.RUNNING,
        "delete": GONE,
    },
}  # fmt: skip


READ = "0" * 64
"""Key of the features of all prompts here."""


def made(engine: sa.Engine, state: JobState) -> UUID:
    """A job in a state, by the steps that lead there."""
    with transaction(engine) as conn:  # read already, for an earlier request of the same prompts
        read = tables.text_features.insert().values(key=READ, blob=b"toy")
        if conn.execute(sa.select(tables.text_features.c.key)).first() is None:
            conn.execute(read)
    job = submit_items(engine, [new_item(n, text_key=READ) for n in range(3)])
    if state is S.QUEUED:
        return job
    if state is S.SUCCEEDED:
        commit_all(engine, claim_some(engine))
        return job
    first = claim_some(engine, limit=1)
    failures = [ItemFailure(first.items[0].id, PROBLEM, retryable=False)]
    with transaction(engine) as conn:
        fail_items(conn, first.lease_token, failures)
    if state in (S.PARTIAL, S.FAILED):
        rest = claim_some(engine)
        if state is S.PARTIAL:
            commit_all(engine, rest)
        else:
            with transaction(engine) as conn:
                fail_items(conn, rest.lease_token, [ItemFailure(i.id, PROBLEM, retryable=False) for i in rest.items])
    elif state in (S.PAUSED, S.CANCELLED):
        with transaction(engine) as conn:
            (pause if state is S.PAUSED else cancel)(conn, "default", job)
    return job


def outcome(conn: sa.Connection, verb: Verb, job: UUID) -> JobState | str:
    try:
        verb(conn, job)
        return get_job(conn, "default", job).state
    except Conflict:
        return REFUSED
    except NotFound:
        return GONE


def test_every_verb_does_to_a_job_in_every_state_what_the_table_says(engine: sa.Engine) -> None:
    assert set(OUTCOMES) == set(JobState)
    for state, expected in OUTCOMES.items():
        job = made(engine, state)
        expected = dict.fromkeys(ALWAYS, state) | expected
        assert set(expected) == set(VERBS)
        for name, verb in VERBS.items():
            with engine.connect() as conn:
                before = get_job(conn, "default", job)
                assert before.state is state
                assert outcome(conn, verb, job) == expected[name], (state, name)
                assert audit(conn) == [], (state, name)
                if expected[name] not in (GONE, REFUSED):
                    tell_why(conn, name, before)
                conn.rollback()
        with transaction(engine) as conn:  # nothing more of it is claimed
            if state in (S.QUEUED, S.RUNNING, S.PAUSED):
                cancel(conn, "default", job)


def tell_why(conn: sa.Connection, verb: str, before: JobRow) -> None:
    """Each actor that changed something left an event with the reason; the others left none."""
    events = events_after(conn, "default", before.id, before.event_seq)
    after = get_job(conn, "default", before.id)
    same = (after.control, after.state, after.ready) == (before.control, before.state, before.ready)
    if same and verb not in ALWAYS:
        assert events == [], verb
    else:
        assert events[0].reason == ALWAYS.get(verb, REASON), verb
