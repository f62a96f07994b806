"""`marey scheduler`: relay, sweeper, evaluations, schedules and webhooks in one process. Several schedulers may run,
and any may die."""

from __future__ import annotations

import os
import socket
import threading
from collections.abc import Sequence
from functools import partial

import sqlalchemy as sa

from marey.core import metrics
from marey.core.addresses import Allowed
from marey.core.errors import InvalidInput, Unreachable
from marey.core.settings import Settings
from marey.core.tls import trusting_context
from marey.db import check_listening, create_engine, outages, transaction
from marey.evaluations import remove_unused_prompts
from marey.jobs import FailureReason, make_due, record_scheduler_heartbeat, retire, sweep
from marey.runtime.app import create_app
from marey.runtime.logs import configure_logging, logger
from marey.runtime.metrics_endpoint import expose
from marey.runtime.queue import redis_client
from marey.runtime.signals import stop_on_signals
from marey.runtime.status import StatusReporter
from marey.scheduler import components
from marey.scheduler.components import EXIT_STALLED, SchedulerComponent, end_stalled, note_progress, watch
from marey.scheduler.evaluations import EvaluationScheduler
from marey.scheduler.periodic import Periodic
from marey.scheduler.relay import Relay, publisher
from marey.scheduler.sending import Sender
from marey.scheduler.servers import CHECK_SECONDS, server_check
from marey.scheduler.webhooks import Deliverer
from marey.storage import open_store
from marey.streams import abandoned_streams, end_stream
from marey.takes import delete_expired, remove_expired_makings, remove_stale_assets, rewrite_files
from marey.webhooks.vault import Vault

log = logger(__name__)

NO_WORKER = FailureReason(
    "unreachable", "no worker served this stream for 15 minutes", hint="Check that a worker of its model runs."
)
STALE_ASSETS_SECONDS = 600.0  # assets of a dead worker wait an hour anyway
ABANDONED_SECONDS = 900.0  # seconds that a stream waits for a worker, or for its worker's successor
ABANDONED_EVERY = 30.0
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
        configure_logging("scheduler", level=chosen.log_level, json=chosen.log_json)
        expose("scheduler", chosen)
        stopping = threading.Event()
        stop_on_signals(stopping)
    database_url = chosen.database_url.get_secret_value()
    queue_url = chosen.queue_url.get_secret_value()
    listen_url = chosen.notifications_url or database_url
    check_listening(listen_url)
    engine = create_engine(database_url)
    app = create_app(queue_url)
    lists = redis_client(queue_url)
    relay = Relay(engine, listen_url, lists, publisher(app), interval=chosen.relay_seconds, stopping=stopping)
    periodic = _periodic(engine, chosen, stopping)
    parts: list[SchedulerComponent] = [relay, *periodic, *_webhooks(engine, chosen, stopping)]
    beats = create_engine(database_url, pool_size=1)
    name = f"scheduler-{socket.gethostname()}-{os.getpid()}"
    presence = Periodic("presence", Presence(beats, name, parts).renew, seconds=BEAT_SECONDS, stopping=stopping)
    parts.append(presence)
    note_progress(engine)
    note_progress(beats)
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
    _retire(beats, name)
    app.close()
    lists.close()
    beats.dispose()
    engine.dispose()
    return 0


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


def _periodic(engine: sa.Engine, chosen: Settings, stopping: threading.Event) -> list[Periodic]:
    assert chosen.queue_url is not None  # validated by the caller
    queue_url = chosen.queue_url.get_secret_value()
    store = open_store(chosen)
    evaluations = EvaluationScheduler(engine, chosen)

    def probe() -> None:
        with transaction(engine):
            pass

    def sweep_once() -> None:
        report = sweep(engine)
        metrics.LEASES_LOST.inc(report.leases_lost)
        metrics.SWEPT.labels("ready").inc(report.items_returned)
        metrics.SWEPT.labels("dead").inc(report.items_dead)
        if report.leases_lost or report.items_dead:
            log.warning("swept", leases_lost=report.leases_lost, returned=report.items_returned, dead=report.items_dead)

    def remove_stale() -> None:
        removed = remove_stale_assets(engine, store)
        if removed:
            log.info("stale_assets_removed", assets=removed)
        remove_expired_makings(engine)
        with transaction(engine) as conn:
            unused = remove_unused_prompts(conn)
        if unused:
            log.info("unused_prompts_removed", sets=unused)

    def end_abandoned() -> None:
        with transaction(engine) as conn:
            for stream in abandoned_streams(conn, ABANDONED_SECONDS):
                end_stream(conn, stream, None, NO_WORKER.message, problem=NO_WORKER)
                log.warning("stream_abandoned", stream=str(stream))

    def retain() -> None:
        deleted = delete_expired(engine, store)
        rewritten = rewrite_files(engine, store)
        if deleted or rewritten:
            log.info("retained", jobs_deleted=deleted, files_rewritten=rewritten)

    return [
        # A lease that expired during an outage of the database is not its worker's fault: let heartbeats come first.
        Periodic(
            "sweeper",
            sweep_once,
            seconds=chosen.sweep_seconds,
            stopping=stopping,
            probe=probe,
            grace=chosen.lease_seconds,
            outages=partial(outages, engine),
            meanwhile=partial(make_due, engine),
        ),
        Periodic("retention", retain, seconds=chosen.retention_seconds, stopping=stopping, probe=probe),
        Periodic("stale_assets", remove_stale, seconds=STALE_ASSETS_SECONDS, stopping=stopping),
        Periodic(
            "streams",
            end_abandoned,
            seconds=ABANDONED_EVERY,
            stopping=stopping,
            probe=probe,
            grace=ABANDONED_EVERY,
            outages=partial(outages, engine),
        ),
        Periodic("servers", server_check(engine, queue_url), seconds=CHECK_SECONDS, stopping=stopping),
        Periodic("evaluations", evaluations.round, seconds=chosen.evaluation_seconds, stopping=stopping),
    ]
