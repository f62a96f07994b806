"""Webhook messages are written with the change they report: once for each event, or not at all."""

from __future__ import annotations

import json
import threading
from uuid import UUID

import pytest
import sqlalchemy as sa

from marey.db import transaction
from marey.evaluations import EvaluationState, cancel_evaluation, lock_evaluation, move_evaluation
from marey.jobs import FailureReason, ItemFailure, Policy, cancel, fail_items, pause, resume, retry, sweep
from marey.streams import NewStream, abandoned_streams, create_stream, end_stream
from marey.tenants import DEFAULT_TENANT, create_key, tables
from marey.webhooks import EventKind, delete_webhook
from tests.servers.jobs import PROBLEM, claim_some, commit_all, let_expire, new_item, parse_texts, submit_items
from tests.support.evaluations import new_evaluation, wait
from tests.support.webhooks import deliveries, events_written, messages_of, new_webhook


def locks_waited_for(engine: sa.Engine) -> int:
    with transaction(engine) as conn:
        return conn.execute(sa.text("SELECT count(*) FROM pg_locks WHERE NOT granted")).scalar_one()


def finish(engine: sa.Engine, job: UUID) -> None:
    parse_texts(engine)
    commit_all(engine, claim_some(engine))


def test_a_job_that_ended_is_told_once_with_its_counters_and_without_its_prompts(engine: sa.Engine) -> None:
    webhook = new_webhook(engine)
    job = submit_items(engine, [new_item(n, "a secret choreography") for n in range(3)], name="secret", comment="x")
    parse_texts(engine)
    claimed = claim_some(engine)
    commit_all(engine, claimed, [item.id for item in claimed.items[:2]])
    assert messages_of(engine, webhook) == []
    with transaction(engine) as conn:
        fail_items(conn, claimed.lease_token, [ItemFailure(claimed.items[2].id, FailureReason("x", "secret"), False)])
    (row,) = deliveries(engine, webhook)
    assert (row.kind, row.state, row.attempts) == ("job.ended", "pending", 0)
    counters = {"total": 3, "ready": 0, "leased": 0, "succeeded": 2, "failed": 1, "dead": 0, "cancelled": 0}
    quality = {"measured": 0, "ok": 0, "flags": {}}
    assert row.data == {"job": str(job), "state": "partial", "counters": counters, "quality": quality}


def test_the_end_of_a_job_tells_the_quality_of_its_motions(engine: sa.Engine) -> None:
    webhook = new_webhook(engine)
    submit_items(engine, 4)
    parse_texts(engine)
    claimed = claim_some(engine)
    commit_all(engine, claimed, [item.id for item in claimed.items[:3]])
    records = [
        {"ok": True, "flags": []},
        {"ok": False, "flags": ["floating", "popping"]},
        {"ok": False, "flags": ["popping"]},
    ]
    with transaction(engine) as conn:
        motions = conn.execute(sa.text("SELECT id FROM motion ORDER BY id")).scalars().all()
        for motion, record in zip(motions, records, strict=True):
            statement = sa.text("UPDATE motion SET metadata = metadata || CAST(:value AS jsonb) WHERE id = :id")
            conn.execute(statement, {"value": json.dumps({"quality": record}), "id": motion})
    commit_all(engine, claimed, [claimed.items[3].id])
    (row,) = deliveries(engine, webhook)
    assert row.data["quality"] == {"measured": 3, "ok": 1, "flags": {"floating": 1, "popping": 2}}


def test_quality_is_counted_only_for_a_subscriber(engine: sa.Engine, monkeypatch: pytest.MonkeyPatch) -> None:
    new_webhook(engine, "https://studio.example/", EventKind.JOB_PAUSED)
    monkeypatch.setattr("marey.jobs.notifications.count_quality", lambda conn, job: pytest.fail("counted"))
    submit_items(engine, 1)
    parse_texts(engine)
    commit_all(engine, claim_some(engine))


def test_every_end_of_a_job_is_an_event_of_its_own(engine: sa.Engine) -> None:
    webhook = new_webhook(engine)
    job = submit_items(engine, 2)
    with transaction(engine) as conn:
        cancel(conn, DEFAULT_TENANT, job)
        cancel(conn, DEFAULT_TENANT, job)  # changes nothing
        retry(conn, DEFAULT_TENANT, job)
        pause(conn, DEFAULT_TENANT, job)
        pause(conn, DEFAULT_TENANT, job)  # changes nothing
        resume(conn, DEFAULT_TENANT, job)
    finish(engine, job)
    assert messages_of(engine, webhook) == [
        ("job.ended", "cancelled"),
        ("job.paused", "paused"),
        ("job.ended", "succeeded"),
    ]


def test_a_job_that_the_sweeper_ends_is_told_of_too(engine: sa.Engine) -> None:
    webhook = new_webhook(engine)
    submit_items(engine, 1)
    parse_texts(engine)
    for _ in range(2):  # a lost lease in a batch, then one alone
        let_expire(engine, claim_some(engine).lease_token)
        sweep(engine, rules=Policy(max_attempts=1))
    assert messages_of(engine, webhook) == [("job.ended", "failed")]


def test_what_is_rolled_back_is_not_told(engine: sa.Engine) -> None:
    webhook = new_webhook(engine)
    job = submit_items(engine, 1)
    with pytest.raises(ZeroDivisionError), transaction(engine) as conn:  # noqa: PT012
        cancel(conn, DEFAULT_TENANT, job)
        assert conn.execute(sa.text("SELECT count(*) FROM webhook_event")).scalar_one() == 1
        raise ZeroDivisionError
    assert (messages_of(engine, webhook), events_written(engine)) == ([], 0)


def test_one_event_serves_every_webhook_that_wants_it_and_nobody_else(engine: sa.Engine) -> None:
    with transaction(engine) as conn:
        conn.execute(sa.insert(tables.tenant).values(id="other"))
    finish(engine, submit_items(engine, 1))
    assert events_written(engine) == 0  # no webhook subscribes
    both = [new_webhook(engine), new_webhook(engine, "https://b.example/", EventKind.JOB_ENDED)]
    deaf = [
        new_webhook(engine, "https://c.example/", EventKind.JOB_PAUSED, EventKind.STREAM_ENDED),
        new_webhook(engine, "https://d.example/", tenant="other"),
    ]
    finish(engine, submit_items(engine, 1))
    assert [messages_of(engine, each) for each in both] == [[("job.ended", "succeeded")]] * 2
    assert messages_of(engine, deaf[0]) == messages_of(engine, deaf[1], "other") == []
    assert events_written(engine) == 1
    assert len({deliveries(engine, each)[0].event for each in both}) == 1
    finish(engine, submit_items(engine, 1, tenant="other"))
    assert messages_of(engine, deaf[1], "other") == [("job.ended", "succeeded")]
    assert events_written(engine) == 2


def test_a_stream_that_is_over_is_told_once(engine: sa.Engine) -> None:
    webhook = new_webhook(engine)
    with transaction(engine) as conn:
        key = create_key(conn, "studio", ["submit"]).key.id
        new = NewStream(DEFAULT_TENANT, key, "dance", "stroller", "stroller-tiny@0", 1, 1200)
        streams = [create_stream(conn, new, limit=4) for _ in range(2)]
        assert end_stream(conn, streams[0], None, "stopped")
        assert not end_stream(conn, streams[0], None, "stopped")
        assert end_stream(conn, streams[1], None, "gone", problem=PROBLEM)
        assert abandoned_streams(conn, 0) == []
    assert [(row.kind, row.data) for row in deliveries(engine, webhook)] == [
        ("stream.ended", {"stream": str(stream), "state": state, "counters": {"frames": 0}, "job": None})
        for stream, state in zip(streams, ("ended", "failed"), strict=True)
    ]


def test_open_streams_without_a_write_for_long_are_abandoned_and_no_others(engine: sa.Engine) -> None:
    with transaction(engine) as conn:
        key = create_key(conn, "studio", ["submit"]).key.id
        new = NewStream(DEFAULT_TENANT, key, "dance", "stroller", "stroller-tiny@0", 1, 1200)
        silent, written, ended = (create_stream(conn, new, limit=4) for _ in range(3))
        assert end_stream(conn, ended, None, "stopped")
        conn.execute(
            sa.text("UPDATE stream SET seen_at = seen_at - interval '901 seconds' WHERE id IN (:silent, :ended)"),
            {"silent": silent, "ended": ended},
        )
        assert list(abandoned_streams(conn, 900)) == [silent]
        assert list(abandoned_streams(conn, 0)) == sorted([silent, written])
        assert list(abandoned_streams(conn, 1000)) == []


@pytest.mark.parametrize("regressed", [None, False, True])
def test_an_evaluation_that_is_worse_is_told_of_a_second_time(engine: sa.Engine, regressed: bool | None) -> None:
    webhook = new_webhook(engine)
    evaluation = new_evaluation(engine)
    with transaction(engine) as conn:
        for state, values in (
            (EvaluationState.GENERATING, {}),
            (EvaluationState.SCORING, {}),
            (EvaluationState.DONE, {"summary": {"made": 1.0}, "regressed": regressed}),
        ):
            row = lock_evaluation(conn, evaluation)
            assert row is not None
            move_evaluation(conn, row, state, "a prompt may stand here", **values)
    data = {"evaluation": str(evaluation), "state": "done", "schedule": None, "regressed": regressed}
    kinds = ["evaluation.ended", *(["evaluation.regressed"] if regressed else [])]
    assert [(row.kind, row.data) for row in deliveries(engine, webhook)] == [(kind, data) for kind in kinds]


def test_an_evaluation_that_is_cancelled_is_told_of(engine: sa.Engine) -> None:
    webhook = new_webhook(engine, "https://a.example/", EventKind.EVALUATION_ENDED)
    evaluation = new_evaluation(engine)
    with transaction(engine) as conn:
        cancel_evaluation(conn, DEFAULT_TENANT, evaluation)
        cancel_evaluation(conn, DEFAULT_TENANT, evaluation)
    assert messages_of(engine, webhook) == [("evaluation.ended", "cancelled")]


def test_a_webhook_that_is_being_removed_costs_a_job_that_ends_a_wait_and_nothing_else(engine: sa.Engine) -> None:
    webhook = new_webhook(engine)
    job = submit_items(engine, 1)
    done = threading.Event()

    def end_job() -> None:
        with transaction(engine) as conn:
            cancel(conn, DEFAULT_TENANT, job)
        done.set()

    thread = threading.Thread(target=end_job)
    with transaction(engine) as conn:
        delete_webhook(conn, DEFAULT_TENANT, webhook)
        thread.start()
        wait(lambda: locks_waited_for(engine) > 0)  # it stands before the row that is going
        assert not done.is_set()
    thread.join(20)
    assert done.is_set()
    assert events_written(engine) == 0


def test_events_hold_ids_states_and_counters_alone(engine: sa.Engine) -> None:
    """No field of an event can carry user text."""
    new_webhook(engine)
    job = submit_items(engine, [new_item(0, "a secret choreography", name="secret", tags=("secret",))], name="secret")
    with transaction(engine) as conn:
        pause(conn, DEFAULT_TENANT, job, "secret")
        cancel(conn, DEFAULT_TENANT, job, "secret")
        evaluation = new_evaluation(engine)
        row = lock_evaluation(conn, evaluation)
        assert row is not None
        move_evaluation(conn, row, EvaluationState.FAILED, "secret")
        found = conn.execute(sa.text("SELECT kind, data FROM webhook_event ORDER BY id")).all()
    assert [row.kind for row in found] == ["job.paused", "job.ended", "evaluation.ended"]
    assert "secret" not in json.dumps([row.data for row in found])
