"""Schedules on a real Postgres: due, missed, paused, two schedulers, a bundle that is gone."""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, timedelta
from uuid import uuid4
from zoneinfo import ZoneInfo

import pytest
import sqlalchemy as sa

from marey.core.errors import InvalidInput, NotFound
from marey.core.settings import Settings
from marey.db import transaction
from marey.evaluations import (
    EvaluationRequest,
    EvaluationState,
    NewEvaluation,
    ScheduleChange,
    change_schedule,
    create_evaluation,
    delete_schedule,
    due_schedules,
    fire_schedule,
    get_schedule,
    list_evaluations,
    list_schedules,
    run_schedule,
)
from marey.evaluations.cron import next_time
from marey.scheduler.evaluations import EvaluationScheduler
from marey.tenants import DEFAULT_TENANT, tables
from tests.support.evaluations import (
    GENERATOR,
    at_once,
    write_generator,
)
from tests.support.schedules import (
    BERLIN,
    CRON,
    change,
    database_now,
    end,
    new_schedule,
    runs,
    schedule_row,
    time_passes,
)

S = EvaluationState


def test_a_new_schedule_is_due_at_its_next_time_in_its_zone(engine: sa.Engine) -> None:
    row = schedule_row(engine, new_schedule(engine, CRON))
    assert row.next is not None
    now = database_now(engine)
    assert now < row.next <= now + timedelta(days=1, hours=1)
    local = row.next.astimezone(ZoneInfo(BERLIN))
    assert (local.hour, local.minute) == (3, 0)
    with transaction(engine) as conn:
        assert due_schedules(conn) == []


def test_a_due_schedule_plans_one_evaluation_for_that_time(engine: sa.Engine, scheduler: EvaluationScheduler) -> None:
    schedule = new_schedule(engine)
    due = time_passes(engine, schedule)
    for _ in range(3):
        scheduler.round()
    (run,) = runs(engine, schedule)
    assert (run.due, run.state, run.name) == (due, S.GENERATING, "nightly")
    assert run.due is not None
    after = schedule_row(engine, schedule).next
    assert after is not None
    assert after > database_now(engine)


def test_missed_times_are_made_up_for_by_one_run_and_never_again(
    engine: sa.Engine, scheduler: EvaluationScheduler
) -> None:
    schedule = new_schedule(engine)
    since = time_passes(engine, schedule, missed=5)
    for _ in range(3):
        scheduler.round()
    (run,) = runs(engine, schedule)
    assert run.due is not None
    assert since < run.due <= database_now(engine)
    cron = schedule_row(engine, schedule).cron
    assert next_time(cron, BERLIN, run.due) > database_now(engine)  # the newest of them
    end(engine, run.id)
    scheduler.round()
    assert len(runs(engine, schedule)) == 1
    with transaction(engine) as conn:
        reason = conn.execute(sa.text("SELECT reason FROM evaluation_event WHERE state = 'planned'")).scalar_one()
    assert f"makes up for what was missed since {since:%Y-%m-%d %H:%M}" in reason


def test_a_time_that_has_its_evaluation_already_gets_no_other(engine: sa.Engine) -> None:
    """Whatever a scheduler believes: the rows are unique."""
    schedule = new_schedule(engine)
    due = time_passes(engine, schedule)
    with transaction(engine) as conn:
        first = fire_schedule(conn, schedule)
    assert first is not None
    new = NewEvaluation(DEFAULT_TENANT, EvaluationRequest(GENERATOR), schedule=schedule, due=due)
    with transaction(engine) as conn:
        assert create_evaluation(conn, new) is None
    end(engine, first)
    time_passes(engine, schedule)  # a clock that was set back
    with transaction(engine) as conn:
        assert fire_schedule(conn, schedule) is None
    assert [run.id for run in runs(engine, schedule)] == [first]


def test_two_schedulers_at_once_fire_a_due_schedule_once(engine: sa.Engine, config: Settings) -> None:
    schedules = [new_schedule(engine) for _ in range(5)]
    for schedule in schedules:
        time_passes(engine, schedule, missed=2)
    at_once(*(EvaluationScheduler(engine, config).round for _ in range(4)))
    assert [len(runs(engine, schedule)) for schedule in schedules] == [1] * 5


def test_a_scheduler_that_has_the_row_keeps_the_other_from_it(engine: sa.Engine) -> None:
    """The same, without chance: the second looks while the first has not committed."""
    schedule = new_schedule(engine)
    time_passes(engine, schedule)
    with engine.connect() as first, engine.connect() as second:
        assert fire_schedule(first, schedule) is not None
        assert due_schedules(second) == [schedule]
        assert fire_schedule(second, schedule) is None
        first.commit()
        assert fire_schedule(second, schedule) is None
    assert len(runs(engine, schedule)) == 1


def test_a_run_that_takes_longer_than_its_interval_is_waited_for(
    engine: sa.Engine, scheduler: EvaluationScheduler
) -> None:
    schedule = new_schedule(engine)
    time_passes(engine, schedule, missed=1)
    scheduler.round()
    with transaction(engine) as conn:
        conn.execute(sa.text("UPDATE schedule SET next_at = now() - interval '1 minute'"))
    scheduler.round()
    (first,) = runs(engine, schedule)
    end(engine, first.id)
    scheduler.round()
    assert len(runs(engine, schedule)) == 2


def test_a_deleted_bundle_marks_the_run_and_the_schedule_goes_on(
    engine: sa.Engine, scheduler: EvaluationScheduler, config: Settings
) -> None:
    schedule = new_schedule(engine, own_prompts=False)
    (config.models / GENERATOR / "manifest.json").rename(config.models / "aside.json")
    time_passes(engine, schedule, missed=1)
    scheduler.round()
    scheduler.round()
    (failed,) = runs(engine, schedule)
    assert failed.state is S.FAILED
    assert f"no model or bundle is named '{GENERATOR}'" in failed.reason
    (config.models / "aside.json").rename(config.models / GENERATOR / "manifest.json")
    with transaction(engine) as conn:
        conn.execute(sa.text("UPDATE schedule SET next_at = now() - interval '1 minute'"))
    scheduler.round()
    assert [run.state for run in runs(engine, schedule)] == [S.FAILED, S.GENERATING]
    row = schedule_row(engine, schedule)
    assert (row.last, row.last_state) == (runs(engine, schedule)[1].id, S.GENERATING)


def test_each_run_measures_the_bundle_that_has_the_name_then(
    engine: sa.Engine, scheduler: EvaluationScheduler, config: Settings
) -> None:
    schedule = new_schedule(engine)
    with transaction(engine) as conn:
        first = run_schedule(conn, DEFAULT_TENANT, schedule)
    scheduler.round()
    end(engine, first)
    write_generator(config.models, weight=1.0)
    with transaction(engine) as conn:
        run_schedule(conn, DEFAULT_TENANT, schedule)
    scheduler.round()
    one, other = (run.request.bundle for run in runs(engine, schedule))
    assert one != other
    assert {one.partition("@")[0], other.partition("@")[0]} == {GENERATOR}
    assert schedule_row(engine, schedule).request.bundle == GENERATOR


def test_a_paused_schedule_is_never_due_and_makes_up_for_nothing(
    engine: sa.Engine, scheduler: EvaluationScheduler
) -> None:
    schedule = new_schedule(engine)
    assert change(engine, schedule, paused=True).next is None
    time_passes(engine, schedule, missed=5)
    scheduler.round()
    assert runs(engine, schedule) == []
    row = change(engine, schedule, paused=False)
    assert row.next is not None
    assert row.next > database_now(engine)
    scheduler.round()
    assert runs(engine, schedule) == []


def test_run_now_works_on_a_paused_schedule_and_moves_no_time(
    engine: sa.Engine, scheduler: EvaluationScheduler
) -> None:
    schedule = new_schedule(engine)
    before = schedule_row(engine, schedule).next
    change(engine, schedule, paused=True)
    with transaction(engine) as conn:
        asked = [run_schedule(conn, DEFAULT_TENANT, schedule) for _ in range(2)]
    assert [run.due for run in runs(engine, schedule)] == [None, None]
    assert [run.id for run in runs(engine, schedule)] == asked
    assert change(engine, schedule, paused=False).next == before


def test_each_schedule_names_its_own_last_run(engine: sa.Engine) -> None:
    schedules = [new_schedule(engine) for _ in range(3)]
    with transaction(engine) as conn:
        asked = [run_schedule(conn, DEFAULT_TENANT, schedule) for schedule in [*schedules[:2], schedules[0]]]
    last = [schedule_row(engine, schedule).last for schedule in schedules]
    assert last == [asked[2], asked[1], None]


def test_new_times_count_from_now_and_other_changes_move_none(engine: sa.Engine) -> None:
    schedule = new_schedule(engine)
    due = time_passes(engine, schedule, missed=5)
    assert change(engine, schedule, name="other").next == due
    row = change(engine, schedule, cron="30 4 * * *", time_zone="UTC")
    assert row.next is not None
    assert row.next > database_now(engine)
    assert (row.next.astimezone(UTC).hour, row.next.minute, row.name) == (4, 30, "other")


def test_what_is_measured_can_be_changed(engine: sa.Engine) -> None:
    schedule = new_schedule(engine)
    row = change(engine, schedule, request=(EvaluationRequest("hgm3", repeats=3), None))
    assert (row.request.bundle, row.request.repeats, row.prompts, row.prompt_count) == ("hgm3", 3, None, None)


def test_a_bad_line_or_zone_changes_nothing(engine: sa.Engine) -> None:
    schedule = new_schedule(engine)
    before = schedule_row(engine, schedule)
    for changes in ({"cron": "0 3 * *"}, {"time_zone": "Mars/Olympus"}, {"cron": "0 3 30 2 *"}):
        with pytest.raises(InvalidInput):
            change(engine, schedule, **changes)
    with pytest.raises(InvalidInput):
        new_schedule(engine, "nonsense")
    assert schedule_row(engine, schedule) == before
    with transaction(engine) as conn:
        assert len(list_schedules(conn, DEFAULT_TENANT).rows) == 1


def test_a_zone_that_is_known_no_longer_pauses_its_schedule_and_marks_the_run(
    engine: sa.Engine, scheduler: EvaluationScheduler
) -> None:
    lost, good = new_schedule(engine), new_schedule(engine)
    for schedule in (lost, good):
        time_passes(engine, schedule, missed=1)
    with transaction(engine) as conn:
        conn.execute(sa.text("UPDATE schedule SET time_zone = 'Mars/Olympus' WHERE id = :id"), {"id": lost})
    for _ in range(2):
        scheduler.round()
    (failed,), (run,) = runs(engine, lost), runs(engine, good)
    assert (failed.state, "no time zone 'Mars/Olympus'" in failed.reason, run.state) == (S.FAILED, True, S.GENERATING)
    assert schedule_row(engine, lost).paused
    with pytest.raises(InvalidInput, match="no time zone"):
        change(engine, lost, paused=False)
    assert not change(engine, lost, paused=False, time_zone="UTC").paused


def test_the_runs_of_a_deleted_schedule_stay_and_go_on(engine: sa.Engine, scheduler: EvaluationScheduler) -> None:
    schedule = new_schedule(engine)
    time_passes(engine, schedule)
    scheduler.round()
    (run,) = runs(engine, schedule)
    with transaction(engine) as conn:
        delete_schedule(conn, DEFAULT_TENANT, schedule)
    with transaction(engine) as conn:
        (left,) = list_evaluations(conn, DEFAULT_TENANT).rows
    assert (left.id, left.schedule, left.due, left.state) == (run.id, None, run.due, S.GENERATING)


def test_a_foreign_tenant_sees_and_changes_nothing(engine: sa.Engine) -> None:
    schedule = new_schedule(engine)
    with transaction(engine) as conn:
        conn.execute(sa.insert(tables.tenant).values(id="other"))
    with transaction(engine) as conn:
        assert list_schedules(conn, "other").rows == ()
        acts: list[Callable[[], object]] = [
            lambda: get_schedule(conn, "other", schedule),
            lambda: change_schedule(conn, "other", schedule, ScheduleChange(paused=True)),
            lambda: delete_schedule(conn, "other", schedule),
            lambda: run_schedule(conn, "other", schedule),
            lambda: get_schedule(conn, DEFAULT_TENANT, uuid4()),
        ]
        for act in acts:
            with pytest.raises(NotFound):
                act()
    assert not schedule_row(engine, schedule).paused
