"""The process of a live loop."""

from __future__ import annotations

import os
import socket
import threading
import time
from typing import cast

import redis
import sqlalchemy as sa

from marey.core.errors import InvalidInput
from marey.core.settings import Settings
from marey.db import create_engine
from marey.jobs import WorkerHeartbeat
from marey.registry import resolve
from marey.runtime.child import wait_for_database
from marey.runtime.live.loop import LiveLoop
from marey.runtime.live.port import LiveModel, LiveModelFactory
from marey.runtime.live.supervisor import StreamSupervisor
from marey.runtime.logs import configure_logging, logger
from marey.runtime.metrics_endpoint import expose
from marey.runtime.queue import redis_client
from marey.runtime.signals import stop_on_signals
from marey.runtime.status import StatusReporter
from marey.streams.states import LIVE_QUEUE

log = logger(__name__)

STOP_SECONDS = 10.0
REDIS_SECONDS = 1.0
"""Deadline of a Redis call: frames stall for this long when a connection falls silent, and a lease lasts 1.5 s."""


def live_main(factory: str, chosen: Settings) -> int:
    """Serve live streams until SIGTERM or SIGINT.

    Args:
        factory: `module:attribute` of a `LiveModelFactory`.

    Raises:
        InvalidInput: a setting is missing.
        NotFound, InvalidBundle: there is no model to load.
        Unreachable: the database does not answer within a minute.
    """
    queue_url = chosen.streams_url or chosen.queue_url
    if chosen.database_url is None or queue_url is None:
        raise InvalidInput(
            "a live worker needs a database and Redis",
            where="MAREY_DATABASE_URL, MAREY_QUEUE_URL",
            hint="Set both, or use `marey serve`, which brings its own.",
        )
    configure_logging("live", level=chosen.log_level, json=chosen.log_json)
    expose("live", chosen)
    stopping = threading.Event()
    stop_on_signals(stopping)
    wait_for_database(chosen)
    model = cast("LiveModelFactory", resolve(factory))()
    engine = create_engine(chosen.database_url.get_secret_value())
    client = redis_client(queue_url.get_secret_value(), timeout=REDIS_SECONDS, connect_timeout=REDIS_SECONDS)
    try:
        _serve(model, engine, client, chosen, stopping)
    finally:
        client.close()
        engine.dispose()
    return 0


def _serve(
    model: LiveModel, engine: sa.Engine, client: redis.Redis, chosen: Settings, stopping: threading.Event
) -> None:
    """Run the loop of the model's sessions on this thread, with a supervisor beside it, until `stopping`."""
    name = f"live-{socket.gethostname()}-{os.getpid()}"
    supervisor: StreamSupervisor
    loop = LiveLoop(lambda: model.open_pool(chosen.live_slots), lambda over: supervisor.over(over))
    worker = WorkerHeartbeat(name, LIVE_QUEUE, socket.gethostname(), os.getpid(), model.device, loop.pool.bundle)
    supervisor = StreamSupervisor(
        engine, client, worker, model.parse, stopping=stopping,
        idle_seconds=chosen.stream_idle_seconds, paused_seconds=chosen.stream_paused_seconds,
    )  # fmt: skip
    supervisor.serve(loop)
    reporter = StatusReporter(chosen.home, name, lambda: time.monotonic() - loop.ticked, stopping)
    reporter.start()
    log.info("ready", worker=name, bundle=loop.pool.bundle, slots=chosen.live_slots)
    try:
        loop.run(stopping)
    finally:
        stopping.set()
        supervisor.join(STOP_SECONDS)
        reporter.join(STOP_SECONDS)
