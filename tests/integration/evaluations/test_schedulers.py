"""Real `marey scheduler` processes: killed in each state, and two at once."""

from __future__ import annotations

import json
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest
import sqlalchemy as sa

from marey.core.settings import Settings
from marey.db import transaction
from marey.evaluations import EvaluationState
from marey.storage import FolderStore
from tests.support.evaluations import (
    ToyEvaluator,
    state_of,
    wait,
)
from tests.support.runtime import Loop
from tests.support.scheduler_processes import Start, scheduler_processes
from tests.support.schedules import (
    new_schedule,
    runs,
    time_passes,
)
from tests.support.toy import ToyHandler, ToyTextHandler
from tests.support.toy_jobs import audit

S = EvaluationState


@pytest.fixture
def start(database_url: str, queue_url: str, config: Settings, tmp_path: Path) -> Iterator[Start]:
    """Starts `marey scheduler`s of this test."""
    settings = {
        "MAREY_HOME": str(config.home),
        "MAREY_MODELS": str(config.models),
        "MAREY_DATABASE_URL": database_url,
        "MAREY_QUEUE_URL": queue_url,
        "MAREY_EVALUATION_SECONDS": "0.05",
        "MAREY_LOG_JSON": "true",
    }
    with scheduler_processes(settings, tmp_path) as start:
        yield start


def test_a_scheduled_run_survives_a_scheduler_killed_in_each_state(
    engine: sa.Engine, folder_store: FolderStore, start: Start, tmp_path: Path
) -> None:
    schedule = new_schedule(engine)
    time_passes(engine, schedule, missed=1)
    loop = Loop(engine, folder_store, ToyTextHandler(), ToyHandler(), ToyEvaluator())
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
    engine: sa.Engine, folder_store: FolderStore, start: Start
) -> None:
    schedules = [new_schedule(engine) for _ in range(3)]
    for schedule in schedules:
        time_passes(engine, schedule, missed=1)
    start()
    start()
    loop = Loop(engine, folder_store, ToyTextHandler(), ToyHandler(), ToyEvaluator())

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
