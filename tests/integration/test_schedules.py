"""Schedules on a real Postgres: due, missed, paused, two schedulers, a bundle that is gone."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from uuid import UUID, uuid4
from zoneinfo import ZoneInfo

import pytest
import sqlalchemy as sa

from services.scheduler.evaluations import Evaluations
from shared.errors import InvalidInput, NotFound
from shared.jobs import (
    DEFAULT_TENANT,
    EvaluationRequest,
    EvaluationRow,
    EvaluationState,
    NewEvaluation,
    NewSchedule,
    ScheduleChange,
    ScheduleRow,
    cancel_evaluation,
    change_schedule,
    create_evaluation,
    create_schedule,
    delete_schedule,
    due_schedules,
    fire_schedule,
    get_schedule,
    list_evaluations,
    list_schedules,
    run_schedule,
    schema,
    store_prompts,
    transaction,
)
from shared.jobs.cron import next_time
from shared.settings import REPOSITORY, Settings
from shared.storage import FolderStore
from tests.support.evaluations import (
    GENERATOR,
    PROMPTS,
    ToyEvaluator,
    ToyTexts,
    models_of,
    state_of,
    write_generator,
)
from tests.support.runtime import Loop
from tests.support.toy import ToyHandler
from tests.support.toy_jobs import audit

BERLIN = "Europe/Berlin"
CRON = "0 3 * * *"
S = EvaluationState


@pytest.fixture
def config(tmp_path: Path) -> Settings:
    return models_of(tmp_path)


@pytest.fixture
def scheduler(engine: sa.Engine, config: Settings) -> Evaluations:
    return Evaluations(engine, config)


def new_schedule(
    engine: sa.Engine,
    cron: str | None = None,
    zone: str = BERLIN,
    *,
    bundle: str = GENERATOR,
    own_prompts: bool = True,
) -> UUID:
    """By default once a day, six hours before now: no test lasts until it is due."""
    if cron is None:
        cron = f"0 {(database_now(engine).astimezone(ZoneInfo(zone)).hour - 6) % 24} * * *"
    request = EvaluationRequest(bundle, source="mine" if own_prompts else "test")
    with transaction(engine) as conn:
        prompts = store_prompts(conn, DEFAULT_TENANT, PROMPTS) if own_prompts else None
        return create_schedule(conn, NewSchedule(DEFAULT_TENANT, cron, zone, request, prompts, "nightly"))


def schedule_row(engine: sa.Engine, schedule: UUID) -> ScheduleRow:
    with transaction(engine) as conn:
        return get_schedule(conn, DEFAULT_TENANT, schedule)


def runs(engine: sa.Engine, schedule: UUID) -> list[EvaluationRow]:
    """Its evaluations, the oldest first."""
    with transaction(engine) as conn:
        return list(reversed(list_evaluations(conn, DEFAULT_TENANT, schedule=schedule).rows))


def time_passes(engine: sa.Engine, schedule: UUID, *, missed: int = 0) -> datetime:
    """As if the schedule were due now, for its last time before now, or for one so many times earlier; that time."""
    row, now = schedule_row(engine, schedule), database_now(engine)
    times = [next_time(row.cron, row.time_zone, now - timedelta(days=missed + 3))]
    while times[-1] <= now:
        times.append(next_time(row.cron, row.time_zone, times[-1]))
    due = times[-2 - missed]
    with transaction(engine) as conn:
        table = schema.schedule
        conn.execute(sa.update(table).where(table.c.id == schedule).values(next_at=due))
    return due


def database_now(engine: sa.Engine) -> datetime:
    with transaction(engine) as conn:
        return conn.execute(sa.text("SELECT clock_timestamp()")).scalar_one()


def end(engine: sa.Engine, evaluation: UUID) -> None:
    with transaction(engine) as conn:
        cancel_evaluation(conn, DEFAULT_TENANT, evaluation)


def change(engine: sa.Engine, schedule: UUID, **changes: object) -> ScheduleRow:
    with transaction(engine) as conn:
        return change_schedule(conn, DEFAULT_TENANT, schedule, ScheduleChange(**changes))  # pyright: ignore[reportArgumentType]


def test_a_new_schedule_is_due_at_its_next_time_in_its_zone(engine: sa.Engine) -> None:
    row = schedule_row(engine, new_schedule(engine, CRON))
    assert row.next is not None
    now = database_now(engine)
    assert now < row.next <= now + timedelta(days=1, hours=1)
    local = row.next.astimezone(ZoneInfo(BERLIN))
    assert (local.hour, local.minute) == (3, 0)
    with transaction(engine) as conn:
        assert due_schedules(conn) == []


def test_a_due_schedule_plans_one_evaluation_for_that_time(engine: sa.Engine, scheduler: Evaluations) -> None:
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


def test_missed_times_are_made_up_for_by_one_run_and_never_again(engine: sa.Engine, scheduler: Evaluations) -> None:
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
    errors: list[BaseException] = []
    barrier = threading.Barrier(4)

    def act() -> None:
        own = Evaluations(engine, config)
        barrier.wait()
        try:
            own.round()
        except BaseException as error:
            errors.append(error)

    threads = [threading.Thread(target=act) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert errors == []
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


def test_a_run_that_takes_longer_than_its_interval_is_waited_for(engine: sa.Engine, scheduler: Evaluations) -> None:
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
    engine: sa.Engine, scheduler: Evaluations, config: Settings
) -> None:
    schedule = new_schedule(engine, own_prompts=False)
    (config.models / GENERATOR / "manifest.json").rename(config.models / "aside.json")
    time_passes(engine, schedule, missed=1)
    scheduler.round()
    scheduler.round()
    (failed,) = runs(engine, schedule)
    assert failed.state is S.FAILED
    assert f"no model or bundle named '{GENERATOR}'" in failed.reason
    (config.models / "aside.json").rename(config.models / GENERATOR / "manifest.json")
    with transaction(engine) as conn:
        conn.execute(sa.text("UPDATE schedule SET next_at = now() - interval '1 minute'"))
    scheduler.round()
    assert [run.state for run in runs(engine, schedule)] == [S.FAILED, S.GENERATING]
    row = schedule_row(engine, schedule)
    assert (row.last, row.last_state) == (runs(engine, schedule)[1].id, S.GENERATING)


def test_each_run_measures_the_bundle_that_has_the_name_then(
    engine: sa.Engine, scheduler: Evaluations, config: Settings
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


def test_a_paused_schedule_is_never_due_and_makes_up_for_nothing(engine: sa.Engine, scheduler: Evaluations) -> None:
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


def test_run_now_works_on_a_paused_schedule_and_moves_no_time(engine: sa.Engine, scheduler: Evaluations) -> None:
    schedule = new_schedule(engine)
    before = schedule_row(engine, schedule).next
    change(engine, schedule, paused=True)
    with transaction(engine) as conn:
        asked = [run_schedule(conn, DEFAULT_TENANT, schedule) for _ in range(2)]
    assert [run.due for run in runs(engine, schedule)] == [None, None]
    assert [run.id for run in runs(engine, schedule)] == asked
    assert change(engine, schedule, paused=False).next == before


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
    engine: sa.Engine, scheduler: Evaluations
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


def test_the_runs_of_a_deleted_schedule_stay_and_go_on(engine: sa.Engine, scheduler: Evaluations) -> None:
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
        conn.execute(sa.insert(schema.tenant).values(id="other"))
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


# --- real processes ---


@pytest.fixture
def start(
    database_url: str, queue_url: str, config: Settings, tmp_path: Path
) -> Iterator[Callable[[], subprocess.Popen[bytes]]]:
    """Starts `marey scheduler`s of this test."""
    started: list[subprocess.Popen[bytes]] = []
    environment = {
        **{name: value for name, value in os.environ.items() if not name.startswith("MAREY_")},
        "MAREY_HOME": str(config.home),
        "MAREY_MODELS": str(config.models),
        "MAREY_DATABASE_URL": database_url,
        "MAREY_QUEUE_URL": queue_url,
        "MAREY_EVALUATION_SECONDS": "0.05",
        "MAREY_LOG_JSON": "true",
    }

    def run() -> subprocess.Popen[bytes]:
        with (tmp_path / f"scheduler{len(started)}.log").open("wb") as log:
            command = [sys.executable, "-m", "tests.chaos.process", "scheduler"]
            started.append(subprocess.Popen(command, cwd=REPOSITORY, env=environment, stdout=log, stderr=log))
        return started[-1]

    yield run
    for process in started:
        process.kill()
        process.wait()


def wait(condition: Callable[[], bool], seconds: float = 120.0) -> None:
    until = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < until, "not in time"
        time.sleep(0.05)


def test_a_scheduled_run_survives_a_scheduler_killed_in_each_state(
    engine: sa.Engine, folder_store: FolderStore, start: Callable[[], subprocess.Popen[bytes]], tmp_path: Path
) -> None:
    schedule = new_schedule(engine)
    time_passes(engine, schedule, missed=1)
    loop = Loop(engine, folder_store, ToyTexts(), ToyHandler(), ToyEvaluator())
    try:
        for state in (S.GENERATING, S.SCORING):
            process = start()
            wait(lambda state=state: any(run.state is state for run in runs(engine, schedule)))
            process.send_signal(signal.SIGKILL)
            process.wait()
            while loop.run():
                pass
    finally:
        loop.close()
    (run,) = runs(engine, schedule)
    assert run.state is S.DONE
    fired = [
        json.loads(line)
        for log in sorted(tmp_path.glob("scheduler*.log"))
        for line in log.read_text().splitlines()
        if "schedule_fired" in line
    ]
    assert [each["evaluation"] for each in fired] == [str(run.id)]
    assert audit(engine, folder_store) == []


def test_two_schedulers_of_one_server_fire_once_and_take_each_step_once(
    engine: sa.Engine, folder_store: FolderStore, start: Callable[[], subprocess.Popen[bytes]]
) -> None:
    schedules = [new_schedule(engine) for _ in range(3)]
    for schedule in schedules:
        time_passes(engine, schedule, missed=1)
    start()
    start()
    loop = Loop(engine, folder_store, ToyTexts(), ToyHandler(), ToyEvaluator())

    def all_done() -> bool:
        loop.run()
        found = [run for schedule in schedules for run in runs(engine, schedule)]
        return len(found) == 3 and {state_of(engine, run.id) for run in found} == {S.DONE}

    try:
        wait(all_done)
    finally:
        loop.close()
    assert [len(runs(engine, schedule)) for schedule in schedules] == [1] * 3
    with transaction(engine) as conn:
        assert conn.execute(sa.text("SELECT count(*) FROM job")).scalar_one() == 6
    assert audit(engine, folder_store) == []
