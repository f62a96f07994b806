"""`marey worker ROLE`: the Celery parent. It imports no handler, hence no torch; its one child does the work."""
# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false, reportUnknownArgumentType=false
# pyright: reportUnknownVariableType=false, reportAttributeAccessIssue=false

from __future__ import annotations

import contextlib
import json
import os
import signal
import socket
import threading
import time
import warnings
from dataclasses import asdict
from pathlib import Path
from typing import Any

import psutil
from celery import signals
from celery.platforms import SecurityWarning

from marey.core.errors import InvalidInput
from marey.core.settings import Settings
from marey.runtime.app import create_app
from marey.runtime.child import NAME_VARIABLE, ROLE_VARIABLE, wait_for_database
from marey.runtime.handler import Role
from marey.runtime.logs import configure_logging, logger
from marey.runtime.status import WorkerStatus, forget_dead, read_status, status_file

log = logger(__name__)

STOP_SECONDS = 25.0  # below the 30 s after which Kubernetes kills
KILL_SECONDS = 3.0
WATCH_SECONDS, WATCH_LOOKS = 30.0, 3
CHILD_LOG_LEVEL = "_MP_FORK_LOGLEVEL_"
"""Variable of Celery: its pool writes lines of a format of its own until the child has set up its logging."""


def worker_main(role: Role, chosen: Settings, *, name: str | None = None) -> int:
    """Run a worker until SIGTERM or SIGINT; return the exit code.

    SIGTERM lets the child write what is finished and release the rest, uncounted; after 25 s it is killed.

    Args:
        role: what to serve; its child reads it from the environment.
        chosen: needs `database_url` and `queue_url`.
        name: unique among the workers; made of role, host and process by default.

    Raises:
        InvalidInput: a setting is missing.
        Unreachable: the database does not answer within a minute.
    """
    if chosen.database_url is None or chosen.queue_url is None:
        raise InvalidInput(
            "a worker needs a database and a queue",
            where="MAREY_DATABASE_URL, MAREY_QUEUE_URL",
            hint="Set both, or use `marey serve`, which brings its own.",
        )
    configure_logging(f"worker-{role.name}", level=chosen.log_level, json=chosen.log_json)
    wait_for_database(chosen)
    forget_dead(chosen.home)
    name = name or f"{role.name}-{socket.gethostname()}-{os.getpid()}"
    os.environ[ROLE_VARIABLE] = json.dumps(asdict(role))
    os.environ[NAME_VARIABLE] = name
    os.environ["MAREY_DATABASE_URL"] = chosen.database_url.get_secret_value()  # the child is a fresh interpreter
    worker = _celery_worker(role, chosen.queue_url.get_secret_value(), name, chosen)
    os.environ.pop(CHILD_LOG_LEVEL, None)
    threading.Thread(target=_watch, args=(chosen.home, name), name="watch", daemon=True).start()
    worker.start()
    status = read_status(chosen.home, name)
    if status is not None and status.error is not None:
        status_file(chosen.home, name).unlink(missing_ok=True)
        return 1
    return int(worker.exitcode or 0)


def _celery_worker(role: Role, queue_url: str, name: str, chosen: Settings) -> Any:
    """Return Celery's worker of the queues of a role, not started; its shutdown stops the child."""
    # Celery warns about pickle as root, which this app does not accept.
    warnings.filterwarnings("ignore", category=SecurityWarning)
    app = create_app(queue_url)
    signals.setup_logging.connect(_keep_logging, weak=False)

    def stop_child(**_: Any) -> None:
        _stop_child(chosen.home, name)

    signals.worker_shutting_down.connect(stop_child, weak=False)
    return app.Worker(
        hostname=f"{role.name}@{name}",
        queues=list(role.handlers),
        loglevel=chosen.log_level,
        without_gossip=True,
        without_mingle=True,
        without_heartbeat=True,  # Celery's own, over the broker; Marey's is in the database
        quiet=True,
    )


def _keep_logging(**_: Any) -> None:
    """Connect to Celery's logging signal: Celery then leaves logging unchanged."""


def _watch(home: Path, name: str) -> None:
    """End this worker when its child is stuck, or no hint reaches it: its supervisor restarts it.

    Three checks must agree: after a suspended laptop resumes, the first status is old.
    """
    stuck = 0
    while stuck < WATCH_LOOKS:
        time.sleep(WATCH_SECONDS)
        stuck = stuck + 1 if _is_stuck(read_status(home, name), time.time()) else 0
    log.error("worker_stuck", worker=name)
    os.kill(os.getpid(), signal.SIGTERM)


def _is_stuck(status: WorkerStatus | None, now: float) -> bool:
    """Return True if the child that wrote the status hangs. The last status of a killed child does not describe its
    successor, which may still be importing; Celery's pool waits for that."""
    return status is not None and psutil.pid_exists(status.pid) and not status.alive(now)


def _stop_child(home: Path, name: str) -> None:
    """Tell the child to release its leases; Celery's warm shutdown alone would wait for the drain to end."""
    status = read_status(home, name)
    try:
        child = psutil.Process(status.pid) if status is not None else None
        if child is None or child.ppid() != os.getpid():
            return  # between two children: the pool ends the next one before it works
        child.send_signal(signal.SIGTERM)
    except psutil.NoSuchProcess:
        return
    threading.Thread(target=_kill_straggler, args=(child,), name="stop", daemon=True).start()


def _kill_straggler(child: psutil.Process) -> None:
    if _ends_within(child, STOP_SECONDS):
        return
    log.error("child_killed", pid=child.pid, seconds=STOP_SECONDS)
    with contextlib.suppress(psutil.NoSuchProcess):
        child.kill()
    _ends_within(child, KILL_SECONDS)
    os._exit(1)


def _ends_within(child: psutil.Process, seconds: float) -> bool:
    """Return True if the child ends in time. Only polls: `wait` would reap it, and Celery's pool would wait for
    ever."""
    until = time.monotonic() + seconds
    while _runs(child):
        if time.monotonic() > until:
            return False
        time.sleep(0.1)
    return True


def _runs(child: psutil.Process) -> bool:
    try:
        return child.status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False
