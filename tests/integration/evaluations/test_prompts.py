"""Prompts that schedules and evaluations share: kept while they are needed; runs are deleted with their request."""

from __future__ import annotations

import threading
from uuid import UUID

import sqlalchemy as sa

from marey.db import transaction
from marey.evaluations import (
    EvaluationRequest,
    NewSchedule,
    ScheduleChange,
    change_schedule,
    create_schedule,
    delete_schedule,
    get_evaluation,
    load_prompts,
    remove_unused_prompts,
    run_schedule,
    store_prompts,
    tables,
)
from marey.items.evaluation_prompts import EvaluationPrompt
from marey.tenants import DEFAULT_TENANT
from tests.support.evaluations import GENERATOR, PROMPTS, new_evaluation, wait

OTHER = (EvaluationPrompt("run"), EvaluationPrompt("jump"))


def sets(engine: sa.Engine) -> int:
    with transaction(engine) as conn:
        return conn.execute(sa.select(sa.func.count()).select_from(tables.prompt_set)).scalar_one()


def schedule_of(engine: sa.Engine, prompts: tuple[EvaluationPrompt, ...]) -> UUID:
    request = EvaluationRequest(GENERATOR, source="mine")
    with transaction(engine) as conn:
        sha256 = store_prompts(conn, DEFAULT_TENANT, prompts)
        return create_schedule(conn, NewSchedule(DEFAULT_TENANT, "0 3 * * 1", "UTC", request, sha256))


def removed(engine: sa.Engine) -> int:
    with transaction(engine) as conn:
        return remove_unused_prompts(conn)


def waiting_for_a_lock(engine: sa.Engine) -> bool:
    query = "SELECT count(*) FROM pg_stat_activity WHERE datname = current_database() AND wait_event_type = 'Lock'"
    with transaction(engine) as conn:
        return conn.execute(sa.text(query)).scalar_one() > 0


def test_prompts_go_with_the_last_that_refers_to_them(engine: sa.Engine) -> None:
    new_evaluation(engine, PROMPTS)
    schedule = schedule_of(engine, OTHER)
    assert (removed(engine), sets(engine)) == (0, 2)
    with transaction(engine) as conn:
        delete_schedule(conn, DEFAULT_TENANT, schedule)
    assert (removed(engine), sets(engine)) == (1, 1)
    with transaction(engine) as conn:
        assert store_prompts(conn, DEFAULT_TENANT, OTHER) == store_prompts(conn, DEFAULT_TENANT, OTHER)
    assert (removed(engine), removed(engine)) == (1, 0)


def test_prompts_that_somebody_is_about_to_use_are_left_alone(engine: sa.Engine) -> None:
    with transaction(engine) as conn:
        store_prompts(conn, DEFAULT_TENANT, OTHER)
    with transaction(engine) as conn:
        store_prompts(conn, DEFAULT_TENANT, OTHER)
        assert removed(engine) == 0  # in another transaction, before the evaluation that needs them is there
    assert removed(engine) == 1


def test_a_run_that_begins_while_its_schedule_changes_measures_what_it_was_changed_to(engine: sa.Engine) -> None:
    schedule = schedule_of(engine, PROMPTS)
    made: list[UUID] = []

    def run() -> None:
        with transaction(engine) as conn:
            made.append(run_schedule(conn, DEFAULT_TENANT, schedule))

    thread = threading.Thread(target=run)
    with transaction(engine) as conn:
        other = EvaluationRequest(GENERATOR, source="other")
        change = ScheduleChange(request=(other, store_prompts(conn, DEFAULT_TENANT, OTHER)))
        change_schedule(conn, DEFAULT_TENANT, schedule, change)
        thread.start()
        wait(lambda: waiting_for_a_lock(engine) or not thread.is_alive())
    thread.join()
    with transaction(engine) as conn:
        row = get_evaluation(conn, DEFAULT_TENANT, made[0])
        assert row.prompts is not None
        assert (row.request.source, load_prompts(conn, DEFAULT_TENANT, row.prompts)) == ("other", OTHER)
