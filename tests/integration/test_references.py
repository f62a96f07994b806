"""References that a person types are found by index, in their own tenant, and never guessed."""

from __future__ import annotations

from dataclasses import replace
from uuid import UUID

import pytest
import sqlalchemy as sa

from marey.core.errors import InvalidInput, NotFound
from marey.db import transaction
from marey.jobs import tables
from marey.streams import NewStream, create_stream
from marey.takes import ReferenceKind, list_motions, resolve_reference
from marey.takes import references as references_module
from marey.tenants import DEFAULT_TENANT, create_key
from marey.webhooks import EventKind, send_test
from tests.servers.jobs import claim_some, commit_all, new_item, new_tenant, parse_texts, submit_items
from tests.support.evaluations import new_evaluation
from tests.support.schedules import new_schedule
from tests.support.webhooks import new_webhook

JOB = ReferenceKind.JOB


def found(
    engine: sa.Engine, kind: ReferenceKind, text: str, tenant: str = DEFAULT_TENANT, webhook: UUID | None = None
) -> list[UUID]:
    with transaction(engine) as conn:
        return [match.id for match in resolve_reference(conn, tenant, kind, text, webhook=webhook)]


def renamed(engine: sa.Engine, job: UUID, identifier: UUID) -> UUID:
    with transaction(engine) as conn:
        conn.execute(sa.update(tables.job).where(tables.job.c.id == job).values(id=identifier))
    return identifier


def one_of_each(engine: sa.Engine) -> dict[ReferenceKind, UUID]:
    job = submit_items(engine, 1, name="a job")
    parse_texts(engine)
    commit_all(engine, claim_some(engine, limit=1))
    webhook = new_webhook(engine, "https://studio.example/hook", *EventKind)
    with transaction(engine) as conn:
        key = create_key(conn, "live", ["submit"]).key.id
        return {
            JOB: job,
            ReferenceKind.MOTION: list_motions(conn, DEFAULT_TENANT, job=job).rows[0].id,
            ReferenceKind.STREAM: create_stream(
                conn, NewStream(DEFAULT_TENANT, key, "walk", "stroller", "m@0", 1, 9), limit=9
            ),
            ReferenceKind.KEY: key,
            ReferenceKind.WEBHOOK: webhook,
            ReferenceKind.DELIVERY: send_test(conn, DEFAULT_TENANT, webhook).event,
            ReferenceKind.EVALUATION: new_evaluation(engine),
            ReferenceKind.SCHEDULE: new_schedule(engine),
        }


def test_everything_with_an_id_is_found_by_it_by_its_last_digits_and_as_the_last(engine: sa.Engine) -> None:
    ids = one_of_each(engine)
    new_tenant(engine, "studio")
    assert set(ids) == set(ReferenceKind)
    for kind, identifier in ids.items():
        webhook = ids[ReferenceKind.WEBHOOK] if kind is ReferenceKind.DELIVERY else None
        digits = identifier.hex
        for text in (str(identifier), digits, digits[-8:], digits[-8:].upper(), digits[-12:], digits[-31:], "last"):
            assert found(engine, kind, text, webhook=webhook) == [identifier], (kind, text)
        for text in (digits[-7:], digits[:8], digits[-4:] + digits[-8:-4], "", "nothing such"):
            if text:
                assert found(engine, kind, text, webhook=webhook) == [], (kind, text)
        if kind is ReferenceKind.DELIVERY:
            with pytest.raises(NotFound):
                found(engine, kind, digits[-8:], "studio", webhook)
            with pytest.raises(InvalidInput, match="webhook"):
                found(engine, kind, digits[-8:])
        else:
            for text in (str(identifier), digits[-8:], "last"):
                assert found(engine, kind, text, "studio") == [], "no other tenant hears of it"


def test_names_are_exact_and_the_newest_come_first(engine: sa.Engine) -> None:
    jobs = [submit_items(engine, 1, name="day 1") for _ in range(3)]
    submit_items(engine, 1, name="day 10")
    assert found(engine, JOB, "day 1") == jobs[::-1]
    assert found(engine, JOB, "DAY 1") == found(engine, JOB, "day") == found(engine, JOB, "day %") == []
    for _ in range(references_module.MOST + 2):
        submit_items(engine, 1, name="many")
    assert len(found(engine, JOB, "many")) == references_module.MOST


def test_readings_that_differ_are_all_answered_and_a_whole_id_has_no_other(engine: sa.Engine) -> None:
    """A job whose name looks like another's id, or like `last`: neither wins."""
    job = submit_items(engine, 1)
    by_digits = submit_items(engine, 1, name=job.hex[-8:])
    assert found(engine, JOB, job.hex[-8:]) == [by_digits, job]
    assert found(engine, JOB, job.hex[-9:]) == [job]
    submit_items(engine, 1, name=str(job))
    assert found(engine, JOB, str(job)) == [job]
    last = submit_items(engine, 1, name="last")
    assert found(engine, JOB, "last") == [last]
    newer = submit_items(engine, 1)
    assert found(engine, JOB, "last") == [newer, last]


def test_of_jobs_made_in_the_same_microsecond_the_last_is_that_of_the_larger_id(engine: sa.Engine) -> None:
    jobs = [submit_items(engine, 1) for _ in range(3)]
    with transaction(engine) as conn:
        conn.execute(sa.text("UPDATE job SET created_at = '2026-01-01'"))
        conn.execute(sa.text("UPDATE job SET name = 'touched' WHERE id = :job"), {"job": jobs[2]})  # moves its row
    assert found(engine, JOB, "last") == [max(jobs)]


def test_two_ids_that_end_alike_are_told_apart_by_more_digits(engine: sa.Engine) -> None:
    ids = [renamed(engine, _empty(engine), UUID(f"0190000{n}-0000-7000-8000-0{n}00deadbeef")) for n in (1, 2)]
    assert found(engine, JOB, "deadbeef") == ids[::-1]
    assert found(engine, JOB, "100deadbeef") == [ids[0]]


def _empty(engine: sa.Engine) -> UUID:
    """A job without items, whose id nothing refers to."""
    with transaction(engine) as conn:
        new = sa.insert(tables.job).values(id=sa.func.gen_random_uuid(), tenant_id=DEFAULT_TENANT)
        return conn.execute(new.returning(tables.job.c.id)).scalar_one()


def test_a_motion_is_found_by_its_place_in_a_job_however_the_job_is_named(engine: sa.Engine) -> None:
    first = replace(new_item(0), variant=0)
    job = submit_items(engine, [first, replace(first, variant=1, seed=9), new_item(1)], name="walk: 10")
    parse_texts(engine)
    commit_all(engine, claim_some(engine, limit=3))
    with transaction(engine) as conn:
        motions = {(row.index, row.variant): row.id for row in list_motions(conn, DEFAULT_TENANT, job=job).rows}
    kind = ReferenceKind.MOTION
    for name in (str(job), job.hex[-8:], "last", "walk: 10"):
        assert found(engine, kind, f"{name}:1") == [motions[1, 0]]
        assert set(found(engine, kind, f"{name}:0")) == {motions[0, 0], motions[0, 1]}
        assert found(engine, kind, f"{name}:0.1") == [motions[0, 1]]
        assert found(engine, kind, f"{name}:0.7") == found(engine, kind, f"{name}:7") == []
    assert found(engine, kind, "nothing:0") == []
    newest = submit_items(engine, 1, name="walk: 10")
    assert found(engine, kind, "walk: 10:1") == [newest, job], "which job is meant is asked first"


def test_plans_go_by_index_and_never_through_the_listing(engine: sa.Engine) -> None:
    ids = one_of_each(engine)
    plans: dict[str, list[str]] = {}
    at = ""

    def explain(conn: sa.Connection, _cursor: object, statement: str, parameters: object, *_: object) -> None:
        if statement.startswith("SELECT"):
            raw = conn.connection.cursor()
            raw.execute("EXPLAIN " + statement, parameters)
            plans.setdefault(at, []).append("\n".join(row[0] for row in raw.fetchall()))

    with engine.connect() as conn:
        conn.execute(sa.text("SET LOCAL enable_seqscan = off"))
        sa.event.listen(engine, "before_cursor_execute", explain)
        for kind, identifier in ids.items():
            webhook = ids[ReferenceKind.WEBHOOK] if kind is ReferenceKind.DELIVERY else None
            at = kind
            resolve_reference(conn, DEFAULT_TENANT, kind, identifier.hex[-8:], webhook=webhook)
            resolve_reference(conn, DEFAULT_TENANT, kind, "a name", webhook=webhook)
        at = "place"
        resolve_reference(conn, DEFAULT_TENANT, ReferenceKind.MOTION, "last:0")
        sa.event.remove(engine, "before_cursor_execute", explain)
        conn.rollback()
    tables = {"motion": "motion_search", "delivery": "webhook_delivery", "key": "api_key"}
    for kind in ids:
        index = f"ix_{tables.get(kind, kind)}_short_id"
        assert any(index in plan for plan in plans[kind]), f"{index}\n" + "\n\n".join(plans[kind])
    for table in ("job", "evaluation", "stream"):
        assert any(f"ix_{table}_name" in plan for plan in plans[table]), "\n\n".join(plans[table])
    assert any("ix_motion_search_filters" in plan for plan in plans["place"])


@pytest.mark.parametrize("text", ["", "x" * 301, "a\0", "\ud800"])
def test_what_is_no_reference_is_refused(engine: sa.Engine, text: str) -> None:
    with pytest.raises(InvalidInput):
        found(engine, JOB, text)


def test_matches_say_what_a_person_chooses_by(engine: sa.Engine) -> None:
    """Everything with a state tells it, and all tell when they were made."""
    ids = one_of_each(engine)
    webhook = ids[ReferenceKind.WEBHOOK]
    told: dict[ReferenceKind, tuple[str | None, str | None]] = {}
    with transaction(engine) as conn:
        for kind, identifier in ids.items():
            of = webhook if kind is ReferenceKind.DELIVERY else None
            (match,) = resolve_reference(conn, DEFAULT_TENANT, kind, str(identifier), webhook=of)
            assert match.created is not None
            told[kind] = match.name, match.state
    assert told[JOB] == ("a job", "succeeded")
    assert told[ReferenceKind.STREAM][1] == "waiting"
    assert told[ReferenceKind.KEY] == ("live", None)
    assert told[ReferenceKind.DELIVERY] == ("webhook.test", "pending")
    assert told[ReferenceKind.EVALUATION][1] is not None
