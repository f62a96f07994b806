"""Starts the real processes, each private to the test, and takes them away again with SIGKILL."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path

import psutil
import redis
import sqlalchemy as sa

from marey.core.errors import Unreachable
from marey.db import create_engine, transaction, upgrade
from marey.embedded import EmbeddedServer, start_postgres, start_valkey
from marey.runtime.queue import SOCKET_SCHEME, redis_client
from marey.runtime.status import read_status
from tests.servers.stalling_proxy import StallingProxy
from tests.support.toy import QUEUE, REFERENCE

REPOSITORY = Path(__file__).resolve().parents[2]


class Cluster:
    """Postgres, Valkey, one scheduler and some toy workers on `home`.

    Args:
        environment: adds settings (store, times).
        proxied: let the processes reach both servers through proxies that can fall silent; the tests do not.
    """

    def __init__(self, home: Path, environment: Mapping[str, str], *, proxied: bool = False) -> None:
        self.home = home
        self.postgres: EmbeddedServer = start_postgres(home)
        self.valkey: EmbeddedServer = start_valkey(home)
        self.engine: sa.Engine = create_engine(self.postgres.url)
        upgrade(self.engine)
        self._stack = contextlib.ExitStack()
        self.proxies: dict[str, StallingProxy] = {}
        database_url, queue_url = self.postgres.url, self.valkey.url
        if proxied:
            database_url, queue_url = self._through_proxies()
        self._environment = {
            **os.environ,
            "MAREY_HOME": str(home),
            "MAREY_DATABASE_URL": database_url,
            "MAREY_QUEUE_URL": queue_url,
            "MAREY_LOG_JSON": "true",
            "OMP_NUM_THREADS": "1",
            **environment,
        }
        self.processes: dict[str, subprocess.Popen[bytes]] = {}
        self._orphans: list[psutil.Process] = []

    def __enter__(self) -> Cluster:
        return self

    def __exit__(self, *_: object) -> None:
        for name in list(self.processes):
            self.kill(name)
        for orphan in self._orphans:
            with contextlib.suppress(psutil.NoSuchProcess):
                orphan.kill()
        self.engine.dispose()
        self._stack.close()
        self.valkey.stop()
        self.postgres.stop()

    def _through_proxies(self) -> tuple[str, str]:
        """URLs of database and queue by way of proxies in front of their sockets, which outlive a restart."""
        database = sa.make_url(self.postgres.url)
        folder, port = str(database.query["host"]), database.port or 5432
        for name, path in {
            "Postgres": f"{folder}/.s.PGSQL.{port}",
            "queue": self.valkey.url.removeprefix(SOCKET_SCHEME),
        }.items():
            self.proxies[name] = self._stack.enter_context(StallingProxy(path))
        reached = database.set(host="127.0.0.1", port=self.proxies["Postgres"].port, query={})
        return (
            reached.render_as_string(hide_password=False),
            f"redis://127.0.0.1:{self.proxies['queue'].port}/0",
        )

    # --- starting ---

    def start_scheduler(self, name: str = "scheduler", **environment: str) -> None:
        """Start a scheduler; `environment` adds settings of its own."""
        self._start(name, environment, "scheduler")

    def start_worker(
        self, name: str, *, queue: str = QUEUE, reference: str = REFERENCE, bundle: str = "", **environment: str
    ) -> None:
        """Start a worker and return at once; `wait_ready` waits for it."""
        self._start(name, environment, "worker", name, queue, reference, bundle)

    def start_api(self, name: str = "api", **environment: str) -> None:
        """Start an API at `MAREY_PORT` of the environment."""
        self._start(name, environment, "api")

    def wait_ready(self, name: str) -> None:
        """Wait until the worker `name` serves."""
        self.wait(lambda: (status := read_status(self.home, name)) is not None and status.ready, f"{name} is ready")

    def _start(self, name: str, environment: Mapping[str, str], *arguments: str) -> None:
        with (self.home / f"{name}.log").open("ab") as log:
            self.processes[name] = subprocess.Popen(
                [sys.executable, "-m", "tests.chaos.process", *arguments],
                cwd=REPOSITORY,
                env={**self._environment, **environment},
                stdout=log,
                stderr=log,
            )

    # --- breaking ---

    def kill(self, name: str, *, children: bool = True) -> None:
        """SIGKILL a process and its children, as when a machine goes; or it alone."""
        process = self.processes.pop(name)
        with contextlib.suppress(psutil.NoSuchProcess):
            found = psutil.Process(process.pid).children(recursive=True)
            self._orphans += [] if children else found
            for child in found if children else []:
                child.kill()
        process.kill()
        process.wait()

    def child(self, name: str) -> int:
        """Process of the working child of a worker; 0 while there is none."""
        status = read_status(self.home, name)
        return status.pid if status is not None and psutil.pid_exists(status.pid) else 0

    def kill_child(self, name: str) -> int:
        """SIGKILL the working child of a worker; its parent starts another."""
        pid = self.child(name)
        assert pid, f"{name} has no child"
        os.kill(pid, signal.SIGKILL)
        return pid

    def terminate(self, name: str, timeout: float = 60.0) -> int:
        """SIGTERM, and the exit code."""
        process = self.processes.pop(name)
        process.send_signal(signal.SIGTERM)
        return process.wait(timeout)

    def flush_queue(self) -> None:
        """FLUSHALL."""
        with self.redis() as client:
            client.flushall()

    def restart_postgres(self, seconds_away: float, how: str = "kill") -> None:
        """Stop Postgres and start it again after a while.

        Args:
            how: "fast" and "immediate" as `pg_ctl -m` does it, "kill" = SIGKILL; "session" = SIGKILL of one of its
                processes, on which it throws out all others and recovers by itself.
        """
        match how:
            case "fast":
                self.postgres.stop()
            case "immediate":
                self.postgres.process.send_signal(signal.SIGQUIT)
                self.postgres.process.wait()
                self.postgres.kill()  # nothing is left but the lock of its folder
            case "session":
                with contextlib.suppress(psutil.NoSuchProcess):
                    psutil.Process(self.postgres.process.pid).children()[-1].kill()
                self._wait_for_postgres()
                return
            case _:
                self.postgres.kill()
        time.sleep(seconds_away)
        self.postgres = start_postgres(self.home)

    def _wait_for_postgres(self) -> None:
        deadline = time.monotonic() + 60
        while True:
            try:
                with transaction(self.engine):
                    return
            except Unreachable:
                assert time.monotonic() < deadline, "Postgres does not recover"
                time.sleep(0.05)

    def restart_valkey(self, seconds_away: float) -> None:
        """SIGKILL Valkey and start it again after a while."""
        self.valkey.kill()
        time.sleep(seconds_away)
        self.valkey = start_valkey(self.home)

    # --- watching ---

    def redis(self) -> redis.Redis:
        """A client of the queue."""
        return redis_client(self.valkey.url)

    def wait(self, condition: Callable[[], bool], what: str, *, seconds: float = 600.0) -> float:
        """Poll until `condition` holds; gives the seconds that took. Fails with the ends of all logs."""
        started = time.monotonic()
        while not condition():
            dead = [name for name, process in self.processes.items() if process.poll() is not None]
            if dead or time.monotonic() - started > seconds:
                raise AssertionError(f"{'ended: ' + ', '.join(dead) if dead else 'not in time'}: {what}\n{self.logs()}")
            time.sleep(0.1)
        return time.monotonic() - started

    def logs(self, lines: int = 40) -> str:
        """The ends of all logs."""
        parts: list[str] = []
        for path in sorted(self.home.glob("*.log")):
            tail = path.read_text(errors="replace").splitlines()[-lines:]
            parts.append("\n".join([f"== {path.name}", *tail]))
        return "\n".join(parts)
