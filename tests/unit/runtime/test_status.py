import os
import subprocess
import sys
import threading
import time
from pathlib import Path

from marey.core.errors import Unreachable
from marey.runtime.status import (
    FRESH,
    TICK_LIMIT,
    StatusReporter,
    WorkerStatus,
    check_health,
    forget_dead,
    read_status,
    write_status,
)
from tests.support.marey import COMMAND


def test_a_living_worker_beats_and_ticks() -> None:
    status = WorkerStatus(pid=7, ready=True, tick_age=3.0, written=1000.0)
    assert status.alive(1000.0)
    assert not status.alive(1000.0 + FRESH + 1), "its threads are dead"
    assert not WorkerStatus(7, True, TICK_LIMIT + 1, 1000.0).alive(1000.0), "it beats, but no hint reaches it"
    assert WorkerStatus(7, False, TICK_LIMIT + 1, 1000.0).alive(1000.0), "loading may take long"


def test_what_was_written_is_read(tmp_path: Path) -> None:
    assert read_status(tmp_path, "one") is None
    status = WorkerStatus(pid=7, ready=True, tick_age=3.0, written=1000.0)
    write_status(tmp_path, "one", status)
    assert read_status(tmp_path, "one") == status


def test_a_half_written_status_is_none(tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "worker-one.json").write_text('{"pid": 7')
    assert read_status(tmp_path, "one") is None


def test_a_probe_wants_every_worker_of_the_machine(tmp_path: Path) -> None:
    assert not healthy(tmp_path, now=1000.0), "there is none"
    write_status(tmp_path, "one", WorkerStatus(7, True, 3.0, 1000.0))
    write_status(tmp_path, "two", WorkerStatus(8, False, 3.0, 1000.0))
    assert healthy(tmp_path, now=1000.0)
    assert not healthy(tmp_path, ready=True, now=1000.0), "two still loads"
    write_status(tmp_path, "two", WorkerStatus(8, True, TICK_LIMIT + 1, 1000.0))
    assert not healthy(tmp_path, now=1000.0), "two is stuck"


def test_workers_of_other_machines_on_the_same_home_are_theirs_to_healthy(tmp_path: Path) -> None:
    write_status(tmp_path, "mine", WorkerStatus(7, True, 3.0, 1000.0))
    write_status(tmp_path, "theirs", WorkerStatus(7, True, 3.0, 0.0, host="elsewhere"))
    assert healthy(tmp_path, now=1000.0)


def test_what_killed_workers_left_is_forgotten(tmp_path: Path) -> None:
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    write_status(tmp_path, "dead", WorkerStatus(ended.pid, True, 3.0, 1000.0))
    write_status(tmp_path, "alive", WorkerStatus(os.getpid(), True, 3.0, 1000.0))
    write_status(tmp_path, "theirs", WorkerStatus(ended.pid, True, 3.0, 1000.0, host="elsewhere"))
    forget_dead(tmp_path)
    assert sorted(path.name for path in (tmp_path / "run").iterdir()) == ["worker-alive.json", "worker-theirs.json"]


def test_a_process_without_children_tells_of_itself_until_it_stops(tmp_path: Path) -> None:
    stopping, silence = threading.Event(), [0.0]
    asked = threading.Event()

    def last_progress() -> float:
        asked.set()
        return silence[0]

    reporter = StatusReporter(tmp_path, "scheduler", last_progress, stopping)
    reporter.start()
    assert asked.wait(60)
    while not (tmp_path / "run" / "worker-scheduler.json").exists():
        time.sleep(0.01)
    assert healthy(tmp_path, ready=True)
    stopping.set()
    reporter.join(60)
    assert not healthy(tmp_path), "who has gone is not healthy"


def test_a_process_that_stands_still_is_not_healthy_though_it_tells_of_itself(tmp_path: Path) -> None:
    write_status(tmp_path, "scheduler", WorkerStatus(os.getpid(), True, float("inf"), 1000.0))
    assert not healthy(tmp_path, now=1000.0)


def test_the_probe_is_a_command(tmp_path: Path) -> None:
    command = [*COMMAND, "probe", "ready"]
    environment = {**os.environ, "MAREY_HOME": str(tmp_path)}
    ran = subprocess.run(command, env=environment, check=False, capture_output=True, text=True)
    assert ran.returncode == 4
    assert "no worker or scheduler runs on this machine" in ran.stderr
    write_status(tmp_path, "one", WorkerStatus(7, False, 3.0, time.time()))
    ran = subprocess.run(command, env=environment, check=False, capture_output=True, text=True)
    assert ran.returncode == 4
    assert "not ready yet: worker-one" in ran.stderr
    write_status(tmp_path, "one", WorkerStatus(7, True, 3.0, time.time()))
    assert subprocess.run(command, env=environment, check=False).returncode == 0


def test_the_probe_says_which_setting_is_wrong() -> None:
    ran = subprocess.run(
        [*COMMAND, "probe"], env={**os.environ, "MAREY_PORT": "abc"}, check=False, capture_output=True, text=True
    )
    assert ran.returncode == 2
    assert "MAREY_PORT" in ran.stderr
    assert "Traceback" not in ran.stderr


def healthy(home: Path, *, ready: bool = False, now: float | None = None) -> bool:
    try:
        check_health(home, ready=ready, now=now)
    except Unreachable:
        return False
    return True
