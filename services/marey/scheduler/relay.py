"""The relay: notifies workers, by hints in Redis, of waiting rows in Postgres. Level-triggered and stateless.

Every half second, and at once on NOTIFY, each queue's list is topped up to min(waiting batches, live workers). A
lost list (FLUSHALL), a lost hint or a second relay need no special handling: the next round reads the rows again,
and a surplus hint finds nothing to claim.
"""
# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping

import kombu.exceptions
import redis
import sqlalchemy as sa
from celery import Celery

from marey.core import metrics
from marey.core.errors import InvalidInput, Unreachable
from marey.db import QUEUE_CHANNEL, Listener, transaction
from marey.jobs import EDIT_QUEUE, EVALUATOR_QUEUE, TEXT_QUEUE, live_workers, waiting_batches
from marey.runtime.app import DRAIN, PUBLISH_RETRY
from marey.runtime.logs import logger
from marey.scheduler.components import SchedulerComponent

log = logger(__name__)

BATCH_SIZES: Mapping[str, int] = {TEXT_QUEUE: 64, EVALUATOR_QUEUE: 1, EDIT_QUEUE: 8}
DEFAULT_BATCH_SIZE = 32
"""Items per claim, for counting waiting batches; a wrong value costs a hint, never an item."""

REFUSED_SECONDS = 30.0  # pause after the database refused to listen, which an operator has to change
LEAST_PAUSE = 0.05  # minimum seconds between two rounds: a submit in many transactions notifies as often
TICK_SECONDS = 30.0  # seconds between hints to idle workers: their claims show that hints still arrive


class Relay(SchedulerComponent):
    """Runs a round each `interval` seconds and on each notification, until `stopping`."""

    def __init__(
        self,
        engine: sa.Engine,
        listen_url: str,
        lists: redis.Redis,
        publish: Callable[[str], None],
        *,
        interval: float,
        stopping: threading.Event,
    ) -> None:
        super().__init__("relay", pause=interval)
        self._engine = engine
        self._listen_url = listen_url
        self._lists = lists
        self._publish = publish
        self._interval = interval
        self._stopping = stopping
        self._next_tick = 0.0

    def run(self) -> None:
        while not self._stopping.is_set():
            self.progressed()  # also while the database is down: waiting for it is not a stall
            try:
                with Listener(self._listen_url, (QUEUE_CHANNEL,)) as listener:
                    while not self._stopping.is_set():
                        self.round()
                        self.progressed()
                        metrics.ROUNDS.labels(self.name, "done").inc()
                        if listener.wait(self._interval):
                            self._stopping.wait(LEAST_PAUSE)
                            while listener.wait(0.0):  # a burst of submits is one round
                                pass
            except Unreachable as error:
                metrics.ROUNDS.labels(self.name, "waiting").inc()
                log.warning("relay_waits", error=error.message)
            except InvalidInput as error:  # a pooler was added since the start
                metrics.ROUNDS.labels(self.name, "failed").inc()
                log.error("relay_refused", error=str(error))
                self._stopping.wait(REFUSED_SECONDS)
            except Exception:
                metrics.ROUNDS.labels(self.name, "failed").inc()
                log.exception("relay_failed")
            self._stopping.wait(self._interval)

    def round(self) -> dict[str, int]:
        """Top up every list once; return the number of hints by queue.

        Raises:
            Unreachable: the database or the queue does not answer.
        """
        with transaction(self._engine) as conn:
            live = live_workers(conn)
            sizes = {queue: BATCH_SIZES.get(queue, DEFAULT_BATCH_SIZE) for queue in live}
            waiting = waiting_batches(conn, sizes) if sizes else {}
        ticking = time.monotonic() >= self._next_tick
        if ticking:
            self._next_tick = time.monotonic() + TICK_SECONDS
        sent: dict[str, int] = {}
        for queue, workers in live.items():
            wanted = workers if ticking else min(waiting.get(queue, 0), workers)
            if wanted == 0:
                continue
            missing = wanted - self._length(queue)
            for _ in range(missing):
                self._publish(queue)
            if missing > 0:
                sent[queue] = missing
                metrics.HINTS.labels(queue).inc(missing)
        return sent

    def _length(self, queue: str) -> int:
        try:
            return int(self._lists.llen(queue))  # pyright: ignore[reportArgumentType] - redis-py types async too
        except redis.RedisError as error:
            raise queue_away(error) from error


def publisher(app: Celery) -> Callable[[str], None]:
    """Return a function that sends one hint to a queue, by name: the scheduler imports no worker.

    Raises (from the returned function): `Unreachable`, after a bounded number of retries.
    """

    def publish(queue: str) -> None:
        try:
            app.send_task(DRAIN, args=[queue], queue=queue, retry=True, retry_policy=PUBLISH_RETRY)
        except (kombu.exceptions.OperationalError, redis.RedisError, OSError) as error:
            raise queue_away(error) from error

    return publish


def queue_away(error: Exception) -> Unreachable:
    """Return the expected error for a broker that does not answer."""
    return Unreachable(
        f"the queue does not answer ({type(error).__name__})",
        where="queue",
        hint="Is it running, and is MAREY_QUEUE_URL right? Embedded: `marey serve` starts it.",
    )
