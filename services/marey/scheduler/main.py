"""`marey scheduler`: relay, sweeper, evaluations, schedules and webhooks in one process. Several schedulers may run,
and any may die."""

from __future__ import annotations

import os
import socket
import threading
from collections.abc import Sequence

import sqlalchemy as sa

from marey.core.addresses import Allowed
from marey.core.errors import InvalidInput, Unreachable
from marey.core.settings import Settings
from marey.core.tls import trusting_context
from marey.db import check_listening, create_engine, transaction
from marey.jobs import record_scheduler_heartbeat, retire
from marey.runtime.app import create_app
from marey.runtime.logs import configure_logging, logger
from marey.runtime.metrics_endpoint import expose
from marey.runtime.queue import redis_client
from marey.runtime.signals import stop_on_signals
from marey.runtime.status import StatusReporter
from marey.scheduler import components
from marey.scheduler.components import EXIT_STALLED, SchedulerComponent, end_stalled, note_progress, watch
from marey.scheduler.periodic import Periodic
from marey.scheduler.relay import Relay, publisher
from marey.scheduler.sending import Sender
from marey.scheduler.upkeep import upkeep
from marey.scheduler.webhooks import Deliverer
from marey.webhooks.vault import Vault

log = logger(__name__)

BEAT_SECONDS = 5.0
STOP_SECONDS = 10.0


def scheduler_main(chosen: Settings, *, stopping: threading.Event | None = None) -> int:
    """Run until SIGTERM or SIGINT, or until `stopping` is set (then no signal handler is installed).

    Database, queue and store may be down at the start: every component waits for its dependencies.

    Raises:
        InvalidInput: a setting is missing or invalid, or the database does not forward notifications.
    """
    if chosen.database_url is None or chosen.queue_url is None:
        raise InvalidInput(
            "a scheduler needs a database and a queue",
            where="MAREY_DATABASE_URL, MAREY_QUEUE_URL",
            hint="Set both, or use `marey serve`, which brings its own.",
        )
    alone = stopping is None
    if stopping is None:
        stopping = _set_up_process(chosen)
    links = Connections(
        chosen.database_url.get_secret_value(), chosen.queue_url.get_secret_value(), chosen.notifications_url
    )
    name = f"scheduler-{socket.gethostname()}-{os.getpid()}"
    parts = _components(links, name, chosen, stopping)
    for part in parts:
        part.start()
    log.info("started", parts=[part.name for part in parts])
    reporter = StatusReporter(chosen.home, name, lambda: max(part.silence() for part in parts), stopping)
    if alone:
        reporter.start()
    if watch(parts, stopping):
        if alone:
            end_stalled()
        stopping.set()
        return EXIT_STALLED
    for part in parts:
        part.join(STOP_SECONDS)
    if alone:
        reporter.join(STOP_SECONDS)
    _retire(links.beats, name)
    links.close()
    return 0


def _set_up_process(chosen: Settings) -> threading.Event:
    """Configure logs, metrics and signals of a process that is only a scheduler; return what its signals set."""
    configure_logging("scheduler", level=chosen.log_level, json=chosen.log_json)
    expose("scheduler", chosen)
    stopping = threading.Event()
    stop_on_signals(stopping)
    return stopping


class Connections:
    """Database and queue, which the components share; each connects when it is used.

    Attributes:
        listen_url: for notifications of the database, which are tried once here.
        engine: of all components; an answered statement is progress.
        beats: one connection for the heartbeat, which waits for no other component.

    Raises:
        InvalidInput: the database does not forward notifications.
    """

    def __init__(self, database_url: str, queue_url: str, notifications_url: str | None) -> None:
        self.queue_url = queue_url
        self.listen_url = notifications_url or database_url
        check_listening(self.listen_url)
        self.engine = create_engine(database_url)
        self.beats = create_engine(database_url, pool_size=1)
        self.app = create_app(queue_url)
        self.lists = redis_client(queue_url)
        note_progress(self.engine)
        note_progress(self.beats)

    def close(self) -> None:
        self.app.close()
        self.lists.close()
        self.beats.dispose()
        self.engine.dispose()


def _components(
    links: Connections, name: str, chosen: Settings, stopping: threading.Event
) -> Sequence[SchedulerComponent]:
    """Return the components of the scheduler `name`, not started yet."""
    relay = Relay(
        links.engine,
        links.listen_url,
        links.lists,
        publisher(links.app),
        interval=chosen.relay_seconds,
        stopping=stopping,
    )
    work: list[SchedulerComponent] = [
        relay,
        *upkeep(links.engine, links.queue_url, chosen, stopping),
        *_webhooks(links.engine, chosen, stopping),
    ]
    presence = Presence(links.beats, name, work)
    return [*work, Periodic("presence", presence.renew, seconds=BEAT_SECONDS, stopping=stopping)]


class Presence:
    """Records in the database that this scheduler works; `marey doctor` and metrics read it."""

    def __init__(self, engine: sa.Engine, name: str, parts: Sequence[SchedulerComponent]) -> None:
        self._engine = engine
        self._name = name
        self._parts = parts

    def renew(self) -> None:
        """Renew the row, unless a component has made no progress for half of the allowed time.

        Raises:
            Unreachable: the database does not answer.
        """
        if any(part.stalled(components.STALL_SECONDS / 2) for part in self._parts):
            return
        with transaction(self._engine) as conn:
            record_scheduler_heartbeat(conn, self._name, host=socket.gethostname(), pid=os.getpid())


def _retire(engine: sa.Engine, name: str) -> None:
    try:
        with transaction(engine) as conn:
            retire(conn, name)
    except Unreachable as error:
        log.warning("not_retired", error=error.message)  # the age of the row shows that this scheduler is gone


def _webhooks(engine: sa.Engine, chosen: Settings, stopping: threading.Event) -> list[Deliverer]:
    """Return the webhook deliverer; none without a key: then the API creates no webhooks."""
    sender = Sender(Allowed.of(chosen.webhook_allow), tls=trusting_context(chosen.ca_file))
    if chosen.webhook_key is None:
        log.warning("webhooks_off", reason="MAREY_WEBHOOK_KEY is not set")
        return []
    vault = Vault.of(chosen)
    seconds = chosen.webhook_seconds
    return [Deliverer(engine, vault, sender, api=chosen.api_url, interval=seconds, stopping=stopping)]
