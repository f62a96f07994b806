"""`marey serve`: Postgres, Valkey, API, scheduler and workers as children of one process."""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import secrets
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import IO

from marey.cli import console
from marey.cli.children import SupervisedProcess, marey, metrics_port, stop_all
from marey.cli.ports import try_port
from marey.cli.roles.serving import PLATFORM, check_device, live_models, role_of, threads_of
from marey.client.health import is_healthy
from marey.client.server_address import Server, read_server, write_server
from marey.core.errors import Conflict, InvalidInput, MareyError
from marey.core.private_home import make_private, open_private
from marey.core.settings import Settings
from marey.db import create_engine, transaction, upgrade
from marey.embedded import EmbeddedServer, make_socket_folder, socket_folder, start_postgres, start_valkey
from marey.storage import open_store
from marey.tenants import create_key, list_keys, revoke_key
from marey.tenants.types import DEFAULT_TENANT
from marey.webhooks.vault import Vault, key_file

KEY_NAME = "serve"
KEY_SCOPES = ("admin", "metrics", "operate", "read", "submit")
TICK = 0.2
HEALTH_SECONDS = 2.0
"""Timeout of a health check of the API."""
WARNINGS = 5
"""The largest number of warnings about paths that were open to other users."""
LOG_LIMIT = 10 * 2**20
KEYS = (
    "{url}/live and other clients want a key: `marey admin keys create NAME` makes one. "
    "Commands on this machine use that in {path}."
)


@dataclass
class Backing:
    """An embedded server that is restarted when it ends."""

    start: Callable[[], EmbeddedServer]
    server: EmbeddedServer = field(init=False)

    def __post_init__(self) -> None:
        self.server = self.start()

    def keep(self) -> None:
        """Restart it if it ended; its clients retry, and its files survive."""
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
        self._children: list[SupervisedProcess] = []
        self._backings: list[Backing] = []

    def run(self) -> None:
        """Serve until SIGTERM or SIGINT.

        Raises:
            Conflict: another server runs on this home, or the port is taken.
            NotFound: there is no model to serve.
            InvalidInput: a setting with which no child could start.
        """
        if (self.home / "lock").exists():
            with self._locked():  # who runs here is told first: another port would not help
                pass
        for queues in self.roles:
            role_of(queues, self.config)  # says what is wrong with a bundle before anything is started
        if self.config.webhook_key is not None:
            Vault.of(self.config)
        check_device(self.config.device, self.roles)
        try_port(self.config.host, self.config.port)
        with self._locked():
            for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
                signal.signal(number, self._on_signal)
            try:
                console.say("Starting the database, the queue and the API …")
                self._start()
                self._watch()
            finally:
                self._stop()

    def _start(self) -> None:
        (self.home / "logs").mkdir(mode=0o700, exist_ok=True)
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
        self._server = Server(self.config.local_url, key, os.getpid())
        environment = self._environment(database_url, queue_url)
        commands = {
            "scheduler": ["scheduler"],
            **{f"worker-{i}": ["worker", "+".join(q), "--only", "queue"] for i, q in enumerate(self.roles, 1)},
            **{f"live-{model}": ["worker", model, "--only", "live"] for model in self._shown()},
        }
        if self.config.text_url is None:
            self._add_text_service(environment)
        self._children.append(self._child("api", ["api"], environment))
        for place, (name, command) in enumerate(commands.items()):
            self._children.append(self._child(name, command, {**environment, **metrics_port(self.config, place)}))

    def _add_text_service(self, environment: dict[str, str]) -> None:
        """One process that parses for the API, on a socket that no other user can open."""
        folder = socket_folder(self.home)
        if not folder.exists():  # where Postgres and Valkey are servers of the user's own
            make_socket_folder(folder, None)
        path = folder / "text.sock"
        environment |= {"MAREY_TEXT_URL": f"unix://{path}", "MAREY_TEXT_KEY": secrets.token_urlsafe(32)}
        own = {**environment, "MAREY_THREADS": "1", "OMP_NUM_THREADS": "1"}
        self._children.append(self._child("text", ["text", "serve", "--socket", str(path)], own))

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

    def _shown(self) -> list[str]:
        """Models with a live loop, in a process of its own: a batch must not hold up a stream."""
        return list(live_models(queue for role in self.roles for queue in role)) if self.config.live_slots else []

    def _environment(self, database_url: str, queue_url: str) -> dict[str, str]:
        keys = {} if self.config.webhook_key else {"MAREY_WEBHOOK_KEY_FILE": str(key_file(self.home))}
        computing = sum(any(queue not in PLATFORM for queue in role) for role in self.roles)
        return {
            **os.environ,
            **keys,
            "MAREY_HOME": str(self.home),
            "MAREY_DATABASE_URL": database_url,
            "MAREY_QUEUE_URL": queue_url,
            "MAREY_STORE": self.config.store or str(self.home / "assets"),
            "MAREY_HOST": self.config.host,
            "MAREY_PORT": str(self.config.port),
            "MAREY_THREADS": str(threads_of(self.config, computing)),
        }

    def _child(self, name: str, arguments: Sequence[str], environment: dict[str, str]) -> SupervisedProcess:
        log = self.home / "logs" / f"{name}.log"
        if log.exists() and log.stat().st_size > LOG_LIMIT:
            log.replace(log.with_suffix(".log.1"))
        return SupervisedProcess(name, marey(*arguments), environment, log)

    def _watch(self) -> None:
        url, announced, ready = self._server.url, False, False
        while not self._stopping:
            now = time.monotonic()
            for backing in self._backings:
                backing.keep()
            for child in self._children:
                child.keep(now)
            if not announced and is_healthy(f"{url}/livez", timeout=HEALTH_SECONDS):
                write_server(self._server, self.home)
                announced = True
                console.say(f"Marey answers at {url} (home {self.home}); loading the model …")
            if announced and not ready and is_healthy(f"{url}/readyz", timeout=HEALTH_SECONDS):
                ready = True
                console.say("Ready. Submit with `marey submit 'a person waves'`; stop with Ctrl-C.")
                console.say(KEYS.format(url=url, path=self.home / "server.json"))
            time.sleep(TICK)

    def _stop(self) -> None:
        if self._children:
            console.say("stopping …")
        for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
            signal.signal(number, signal.SIG_IGN)  # a second Ctrl-C must not leave children behind
        (self.home / "server.json").unlink(missing_ok=True)
        stop_all(self._children)
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
            opened = make_private(self.home)
            stream = open_private(self.home / "lock", "a+", encoding="utf-8")
        except OSError as error:
            raise InvalidInput(
                f"cannot be written: {error.strerror}", where=str(self.home), hint="Set MAREY_HOME to another folder."
            ) from error
        with stream:
            try:
                fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                raise Conflict(self._who(stream), where=str(self.home), hint=_WHO_HINT) from None
            for warning in opened[:WARNINGS]:
                console.say(warning)
            if len(opened) > WARNINGS:
                console.say(f"… and {len(opened) - WARNINGS} more files and folders of this home")
            stream.truncate(0)
            stream.write(json.dumps({"pid": os.getpid()}))
            stream.flush()
            yield

    def _who(self, stream: IO[str]) -> str:
        server = read_server(self.home)
        if server is not None:
            return f"a server runs here already: {server.url}, process {server.pid}"
        stream.seek(0)
        return f"a server is starting here already: {stream.read() or 'process unknown'}"


_WHO_HINT = "Use that one, stop it, or give this one its own MAREY_HOME and --port."
