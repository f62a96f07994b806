"""`marey serve`: Postgres, Valkey, API, scheduler and workers as children of one process."""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from io import TextIOWrapper
from pathlib import Path

from services.cli import console
from services.cli.place import Server, read_server, write_server
from services.cli.roles import GENERATORS, role_of, threads_of
from shared.errors import Conflict, InvalidInput, MareyError
from shared.jobs import create_engine, create_key, list_keys, revoke_key, transaction, upgrade
from shared.jobs.types import DEFAULT_TENANT
from shared.runtime.embedded import EmbeddedServer, start_postgres, start_valkey
from shared.settings import Settings
from shared.storage import open_store

KEY_NAME = "serve"
KEY_SCOPES = ("admin", "operate", "read", "submit")
TICK = 0.2
FIRST_PAUSE, LONGEST_PAUSE = 0.5, 30.0
"""Seconds before a child that ended is started again; doubled each time it ends within a minute."""
STEADY = 60.0
STOP_SECONDS = 35.0
"""Workers release their leases within 30 s; longer and they are killed."""
LOG_LIMIT = 10 * 2**20


@dataclass
class Child:
    """A process of ours, started again when it ends."""

    name: str
    command: Sequence[str]
    environment: dict[str, str]
    log: Path
    process: subprocess.Popen[bytes] | None = None
    pause: float = FIRST_PAUSE
    began: float = 0.0
    due: float = 0.0

    def keep(self, now: float) -> None:
        """Start it if it does not run and its pause is over."""
        if self.process is None:
            if now >= self.due:
                self.start(now)
            return
        code = self.process.poll()
        if code is None:
            return
        if now - self.began > STEADY:
            self.pause = FIRST_PAUSE
        console.say(f"{self.name} ended ({_how(code)}); starting it again in {self.pause:g} s. Its log: {self.log}")
        self.process, self.due = None, now + self.pause
        self.pause = min(self.pause * 2, LONGEST_PAUSE)

    def start(self, now: float) -> None:
        """Start it. It gets SIGTERM when we die, however we die."""
        with self.log.open("ab") as output:
            self.process = subprocess.Popen(
                [*_death_signal(), *self.command],
                env=self.environment,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                start_new_session=True,  # Ctrl-C is for us; we stop the children in order
            )
        self.began = now

    def terminate(self) -> None:
        """Ask it to end."""
        if self.process is not None and self.process.poll() is None:
            self.process.terminate()

    def join(self, seconds: float) -> None:
        """Wait until it has ended, by force after `seconds`."""
        if self.process is None:
            return
        try:
            self.process.wait(seconds)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()


@dataclass
class Backing:
    """An embedded server, started again when it ends."""

    start: Callable[[], EmbeddedServer]
    server: EmbeddedServer = field(init=False)

    def __post_init__(self) -> None:
        self.server = self.start()

    def keep(self) -> None:
        """Start it again if it ended: its children are patient, and its files survive."""
        if not self.server.alive():
            console.say(f"{self.server.name} ended; starting it again. Its log: {self.server.log}")
            self.server.stop()
            with contextlib.suppress(MareyError):  # tried again at the next tick
                self.server = self.start()


class Supervisor:
    """One embedded server of one `MAREY_HOME`."""

    def __init__(self, config: Settings, roles: Sequence[tuple[str, ...]]) -> None:
        self.config = config
        self.roles = roles
        self.home = config.home.expanduser().absolute()
        self._stopping = False
        self._children: list[Child] = []
        self._backings: list[Backing] = []

    def run(self) -> None:
        """Serve until SIGTERM or SIGINT.

        Raises:
            Conflict: another server runs on this home, or the port is taken.
            NotFound: there is no model to serve.
        """
        for queues in self.roles:
            role_of(queues, self.config)  # says what is wrong with a bundle before anything is started
        _free_port(self.config.host, self.config.port)
        with self._locked():
            for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
                signal.signal(number, self._on_signal)
            try:
                self._start()
                self._watch()
            finally:
                self._stop()

    def _start(self) -> None:
        (self.home / "logs").mkdir(exist_ok=True)
        database_url, queue_url = self._start_backings()
        engine = create_engine(database_url)
        upgrade(engine)
        open_store(self.config).prepare()
        with transaction(engine) as conn:
            for old in list_keys(conn, DEFAULT_TENANT):
                if old.name == KEY_NAME and old.revoked is None:
                    revoke_key(conn, DEFAULT_TENANT, old.id)
            key = create_key(conn, KEY_NAME, KEY_SCOPES).secret
        engine.dispose()
        self._server = Server(f"http://{_reachable(self.config.host)}:{self.config.port}", key, os.getpid())
        environment = self._environment(database_url, queue_url)
        self._children = [
            self._child("api", ["api"], environment),
            self._child("scheduler", ["scheduler"], environment),
            *(self._child(f"worker-{i}", ["worker", "+".join(q)], environment) for i, q in enumerate(self.roles, 1)),
        ]

    def _start_backings(self) -> tuple[str, str]:
        """URLs of database and queue: those of the settings, else embedded ones."""
        database, queue = self.config.database_url, self.config.queue_url
        if database is None:
            self._backings.append(Backing(lambda: start_postgres(self.home)))
        if queue is None:
            self._backings.append(Backing(lambda: start_valkey(self.home)))
        urls = {backing.server.name: backing.server.url for backing in self._backings}
        return (
            urls["Postgres"] if database is None else database.get_secret_value(),
            urls["Valkey"] if queue is None else queue.get_secret_value(),
        )

    def _environment(self, database_url: str, queue_url: str) -> dict[str, str]:
        computing = sum(any(queue in GENERATORS for queue in role) for role in self.roles)
        return {
            **os.environ,
            "MAREY_HOME": str(self.home),
            "MAREY_DATABASE_URL": database_url,
            "MAREY_QUEUE_URL": queue_url,
            "MAREY_STORE": self.config.store or str(self.home / "assets"),
            "MAREY_HOST": self.config.host,
            "MAREY_PORT": str(self.config.port),
            "MAREY_THREADS": str(threads_of(self.config, computing)),
        }

    def _child(self, name: str, arguments: Sequence[str], environment: dict[str, str]) -> Child:
        log = self.home / "logs" / f"{name}.log"
        if log.exists() and log.stat().st_size > LOG_LIMIT:
            log.replace(log.with_suffix(".log.1"))
        return Child(name, [sys.executable, "-m", "services.cli", *arguments], environment, log)

    def _watch(self) -> None:
        url, announced, ready = self._server.url, False, False
        while not self._stopping:
            now = time.monotonic()
            for backing in self._backings:
                backing.keep()
            for child in self._children:
                child.keep(now)
            if not announced and _answers(f"{url}/livez"):
                write_server(self._server, self.home)
                announced = True
                console.say(f"Marey answers at {url} (home {self.home}); loading the model …")
            if announced and not ready and _answers(f"{url}/readyz"):
                ready = True
                console.say("Ready. Submit with `marey submit 'a person waves'`; stop with Ctrl-C.")
            time.sleep(TICK)

    def _stop(self) -> None:
        if self._children:
            console.say("stopping …")
        for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
            signal.signal(number, signal.SIG_IGN)  # a second Ctrl-C must not leave children behind
        (self.home / "server.json").unlink(missing_ok=True)
        for child in self._children:
            child.terminate()
        for child in self._children:
            child.join(STOP_SECONDS)
        for backing in reversed(self._backings):
            backing.server.stop()

    def _on_signal(self, _number: int, _frame: object) -> None:
        self._stopping = True

    @contextlib.contextmanager
    def _locked(self) -> Iterator[None]:
        """Hold `home/lock`.

        Raises:
            Conflict: a living process holds it.
            InvalidInput: the home cannot be written.
        """
        try:
            self.home.mkdir(mode=0o700, parents=True, exist_ok=True)
            stream = (self.home / "lock").open("a+", encoding="utf-8")
        except OSError as error:
            raise InvalidInput(
                f"cannot be written: {error.strerror}", where=str(self.home), hint="Set MAREY_HOME to another folder."
            ) from error
        with stream:
            try:
                fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                raise Conflict(self._who(stream), where=str(self.home), hint=_WHO_HINT) from None
            stream.truncate(0)
            stream.write(json.dumps({"pid": os.getpid()}))
            stream.flush()
            yield

    def _who(self, stream: TextIOWrapper) -> str:
        server = read_server(self.home)
        if server is not None:
            return f"a server runs here already: {server.url}, process {server.pid}"
        stream.seek(0)
        return f"a server is starting here already: {stream.read() or 'process unknown'}"


_WHO_HINT = "Use that one, stop it, or give this one its own MAREY_HOME and --port."


def _free_port(host: str, port: int) -> None:
    """Raises:
    Conflict: somebody listens there.
    """
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family, socket.SOCK_STREAM) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except OSError as error:
            raise Conflict(
                f"port {port} of {host} cannot be used: {error.strerror}", hint="Choose another with --port (0 = any)."
            ) from error


def any_port(host: str) -> int:
    """A port that is free now."""
    with socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET, socket.SOCK_STREAM) as probe:
        probe.bind((host, 0))
        return probe.getsockname()[1]


def _reachable(host: str) -> str:
    """The name clients on this machine use for an address to listen on."""
    name = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(host, host)  # noqa: S104
    return f"[{name}]" if ":" in name else name


def _answers(url: str) -> bool:
    try:
        with urllib.request.urlopen(url, timeout=2) as response:  # noqa: S310
            return response.status == 200
    except (urllib.error.URLError, OSError):
        return False


def _death_signal() -> list[str]:
    setpriv = shutil.which("setpriv")
    return [setpriv, "--pdeathsig", "TERM"] if setpriv else []


def _how(code: int) -> str:
    return f"killed by {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"
