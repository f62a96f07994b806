"""Status files for probes: `home/run/worker-NAME.json`, written every few seconds by a worker's child, by live workers
and by the scheduler.

`marey probe` reads them: the liveness probe of a machine's workers, with `ready` the readiness probe.
"""

from __future__ import annotations

import json
import os
import socket
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path

import psutil

from marey.core.errors import Unreachable
from marey.core.whole_files import whole_file

TELL_SECONDS = 3.0
FRESH = 15.0  # seconds; a status file older than this belongs to a child that no longer beats
TICK_LIMIT = 600.0  # longest legitimate silence: a drain's 300 s of claims and the last batch's end, doubled


@dataclass(frozen=True)
class WorkerStatus:
    """Status of one process."""

    pid: int
    ready: bool
    """The model is loaded and queues are served."""
    tick_age: float
    """Seconds since the last claim or step of progress. Idle workers tick too: the relay sends each a hint."""
    written: float
    """Wall clock."""
    host: str = field(default_factory=socket.gethostname)
    error: str | None = None
    """Reason of a failed start; the parent ends then."""

    def alive(self, now: float) -> bool:
        """Return True if a liveness probe should pass: its threads beat, and hints reach it."""
        return now - self.written < FRESH and (not self.ready or self.tick_age < TICK_LIMIT)


def status_file(home: Path, name: str) -> Path:
    """Return the status file of the worker `name`."""
    return home / "run" / f"worker-{name}.json"


def read_status(home: Path, name: str) -> WorkerStatus | None:
    """Return the status of the worker `name`; None if there is none (yet)."""
    return _read(status_file(home, name))


def write_status(home: Path, name: str, status: WorkerStatus) -> None:
    """Replace the status of the worker `name`."""
    path = status_file(home, name)
    path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    with whole_file(path, private=True) as part:
        part.write_text(json.dumps(asdict(status)), encoding="utf-8")


def check_health(home: Path, *, ready: bool = False, now: float | None = None) -> None:
    """Check the processes of this machine that keep a status: at least one exists, and none is stuck.

    Args:
        ready: their models are loaded too.

    Raises:
        Unreachable: a check failed.
    """
    now = time.time() if now is None else now
    found = dict(_of_this_host(home))
    if not found:
        raise Unreachable("no worker or scheduler runs on this machine", where=str(home / "run"))
    stuck = [path.stem for path, status in found.items() if not status.alive(now)]
    if stuck:
        raise Unreachable(f"without a sign of life or of progress: {', '.join(stuck)}", where=str(home / "run"))
    loading = [path.stem for path, status in found.items() if not status.ready]
    if ready and loading:
        raise Unreachable(f"not ready yet: {', '.join(loading)}", where=str(home / "run"))


def forget_dead(home: Path) -> None:
    """Remove status files of killed workers of this machine."""
    for path, status in _of_this_host(home):
        if not psutil.pid_exists(status.pid):
            path.unlink(missing_ok=True)


class StatusReporter(threading.Thread):
    """Writes the status of this process until `stopping`, then removes it.

    Args:
        name: unique among the workers of `home`.
        silence: seconds since the last sign of progress.
    """

    def __init__(self, home: Path, name: str, silence: Callable[[], float], stopping: threading.Event) -> None:
        super().__init__(name="status", daemon=True)
        self._home, self._name = home, name
        self._silence = silence
        self._stopping = stopping

    def run(self) -> None:
        forget_dead(self._home)
        while not self._stopping.is_set():
            status = WorkerStatus(os.getpid(), ready=True, tick_age=self._silence(), written=time.time())
            write_status(self._home, self._name, status)
            self._stopping.wait(TELL_SECONDS)
        status_file(self._home, self._name).unlink(missing_ok=True)


def _of_this_host(home: Path) -> Iterator[tuple[Path, WorkerStatus]]:
    """Return the statuses of this host. Containers may share a home; each checks its own."""
    host = socket.gethostname()
    for path in (home / "run").glob("worker-*.json"):
        status = _read(path)
        if status is not None and status.host == host:
            yield path, status


def _read(path: Path) -> WorkerStatus | None:
    try:
        return WorkerStatus(**json.loads(path.read_text(encoding="utf-8")))
    except (FileNotFoundError, ValueError, TypeError):
        return None
