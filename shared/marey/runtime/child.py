"""The one child of a worker: handlers, threads and connections, created after the spawn and kept until the end."""

from __future__ import annotations

import json
import os
import signal
import socket
import threading
import time
from collections.abc import Collection
from types import FrameType
from typing import cast
from uuid import UUID

from marey.core.errors import InvalidInput, Unreachable
from marey.core.settings import Settings, settings
from marey.core.tracing import configure_tracing, end_tracing
from marey.db import HEARTBEAT, create_engine, transaction
from marey.jobs import HeartbeatReply, WorkerHeartbeat, beat, heartbeat, leased_items, retire
from marey.registry import resolve
from marey.runtime.committer import Committer
from marey.runtime.faults import retry_unreachable
from marey.runtime.handler import Handler, HandlerFactory, Role
from marey.runtime.lease import Heartbeat
from marey.runtime.logs import configure_logging, logger
from marey.runtime.loop import Drain, end_child
from marey.runtime.metrics_endpoint import expose, measure_gpu
from marey.runtime.status import WorkerStatus, status_file, write_status
from marey.storage import open_store

log = logger(__name__)

ROLE_VARIABLE = "MAREY_CHILD_ROLE"
"""Environment variable that tells a child, a fresh interpreter, what to serve."""
NAME_VARIABLE = "MAREY_WORKER_NAME"


def import_handler(reference: str) -> Handler:
    """Import `module:attribute` and call it.

    Raises:
        InvalidInput: there is no such module or attribute.
    """
    try:
        factory = cast("HandlerFactory", resolve(reference))
    except (ImportError, AttributeError) as error:
        raise InvalidInput(
            f"the handler {reference!r} cannot be imported: {error}",
            where="worker",
            hint="Install the extra it needs (`pip install 'marey[worker]'`), or correct `module:attribute`.",
        ) from error
    return factory()


class Child:
    """Runs drains; lives as long as its process."""

    def __init__(self, role: Role, name: str, chosen: Settings) -> None:
        if chosen.database_url is None:
            raise InvalidInput("a worker needs a database", where="MAREY_DATABASE_URL", hint="`marey serve` sets it.")
        url = chosen.database_url.get_secret_value()
        self._role = role
        self._name = name
        self._settings = chosen
        self._engine = create_engine(url, pool_size=4)
        # Separate engine: a heartbeat never waits for a commit's connection.
        self._beats = create_engine(url, pool_size=1, deadline=HEARTBEAT)
        self._stopping = threading.Event()
        self._ready = False
        self._ticked = time.monotonic()
        self._heartbeat = Heartbeat(
            self._renew,
            interval=chosen.heartbeat_seconds,
            stopping=self._stopping,
            present=self._present,
            held_by=self._held_by,
            stall_seconds=chosen.stall_seconds,
            stuck=end_child,
        )
        store = open_store(chosen)
        self._committer = Committer(self._engine, store, self._heartbeat, self._stopping)
        handlers = {queue: import_handler(reference) for queue, reference in role.handlers.items()}
        self._drain = Drain(
            self._engine,
            self._worker,
            handlers,
            heartbeat=self._heartbeat,
            committer=self._committer,
            store=store,
            stopping=self._stopping,
            ticked=self._tick,
        )

    @classmethod
    def of_environment(cls) -> Child:
        """Create the child that the parent's environment describes."""
        role = Role(**json.loads(os.environ[ROLE_VARIABLE]))
        return cls(role, os.environ[NAME_VARIABLE], settings())

    def start(self) -> None:
        """Start the threads, preload models, and report the worker as ready.

        Raises: whatever a handler raises on loading.
        """
        configure_logging(f"worker-{self._role.name}", level=self._settings.log_level, json=self._settings.log_json)
        configure_tracing(f"worker-{self._role.name}")
        expose("worker", self._settings)
        signal.signal(signal.SIGTERM, self._on_sigterm)
        self._tell_status()  # the parent finds the child by it
        self._heartbeat.start()
        self._committer.start()
        for queue, bundle in self._role.preload.items():
            self._drain.load(queue, bundle)
        self._ready = True
        try:
            self._present()
        except Unreachable as error:
            log.warning("presence_failed", error=error.message)  # the heartbeat retries
        log.info("ready", worker=self._name, queues=list(self._role.handlers))

    def drain(self) -> int:
        """Serve the queues; return the number of claimed items."""
        self._tick()
        return self._drain.drain(self._settings.drain_seconds)

    def stop(self) -> None:
        """Release all leases and remove the worker's row."""
        self._stopping.set()
        self._ready = False
        self._committer.wait_until_idle(5.0)
        self._heartbeat.close()
        status_file(self._settings.home, self._name).unlink(missing_ok=True)
        try:
            with transaction(self._beats) as conn:
                for queue in self._role.handlers:
                    retire(conn, self._worker(queue))
        except Unreachable as error:
            log.warning("not_retired", error=error.message)  # the age of the row shows that this worker is gone
        end_tracing()  # billiard ends this process without the usual exit handlers

    def _on_sigterm(self, _signal: int, _frame: FrameType | None) -> None:
        self._stopping.set()

    def _tick(self) -> None:
        self._ticked = time.monotonic()

    def _worker(self, queue: str) -> str:
        return f"{self._name}/{queue}"

    def _renew(self, token: UUID, items: Collection[UUID], progressed: bool) -> HeartbeatReply:
        with transaction(self._beats) as conn:
            return heartbeat(conn, token, items, progressed=progressed)

    def _held_by(self, token: UUID) -> frozenset[UUID]:
        with transaction(self._beats) as conn:
            return leased_items(conn, token)

    def _tell_status(self) -> None:
        age = time.monotonic() - self._ticked
        write_status(self._settings.home, self._name, WorkerStatus(os.getpid(), self._ready, age, time.time()))

    def _present(self) -> None:
        """Report that this worker is alive: to the relay by row, to probes by file."""
        measure_gpu()
        try:
            if self._ready and not self._stopping.is_set():
                self._beat()
        finally:
            self._tell_status()

    def _beat(self) -> None:
        with transaction(self._beats) as conn:
            for queue in self._role.handlers:
                loaded = self._drain.loaded.get(queue)
                beat(
                    conn,
                    WorkerHeartbeat(
                        id=self._worker(queue),
                        queue=queue,
                        host=socket.gethostname(),
                        pid=os.getpid(),
                        device=self._settings.device,
                        bundle=loaded.bundle if loaded else None,
                        batch_key=loaded.batch_key if loaded else None,
                    ),
                )


def wait_for_database(chosen: Settings, seconds: float = 60.0) -> None:
    """Wait until the database answers.

    Raises:
        Unreachable: it did not.
    """
    assert chosen.database_url is not None  # validated at the process's edge
    engine = create_engine(chosen.database_url.get_secret_value(), pool_size=1)

    def ask() -> None:
        with transaction(engine):
            pass

    try:
        retry_unreachable(ask, seconds=seconds)
    finally:
        engine.dispose()
