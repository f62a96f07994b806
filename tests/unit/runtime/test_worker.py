import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from marey.runtime import worker
from marey.runtime.status import TICK_LIMIT, WorkerStatus, write_status


def test_a_worker_that_hints_no_longer_reach_ends_itself(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    sent: list[tuple[int, int]] = []
    looks: list[float] = []

    def sleep(_seconds: float) -> None:
        looks.append(_seconds)
        stuck = len(looks) != 3  # alive at the third look: the count begins anew
        age = TICK_LIMIT + 1 if stuck else 0.0
        write_status(tmp_path, "one", WorkerStatus(os.getpid(), ready=True, tick_age=age, written=time.time()))

    monkeypatch.setattr(worker.time, "sleep", sleep)
    # psutil asks by signal 0 whether a process is there.
    monkeypatch.setattr(worker.os, "kill", lambda pid, number: sent.append((pid, number)) if number else None)
    worker._watch(tmp_path, "one")
    assert sent == [(os.getpid(), signal.SIGTERM)]
    assert len(looks) == 3 + worker.WATCH_LOOKS


def test_the_last_word_of_a_killed_child_does_not_end_its_worker() -> None:
    with subprocess.Popen([sys.executable, "-c", ""]) as child:
        pass
    old = time.time() - 3600
    assert worker._is_stuck(WorkerStatus(os.getpid(), ready=True, tick_age=0.0, written=old), time.time())
    assert not worker._is_stuck(WorkerStatus(child.pid, ready=True, tick_age=0.0, written=old), time.time())
    assert not worker._is_stuck(None, time.time())
