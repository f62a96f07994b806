"""Webhook delivery from the outbox, in a thread and an event loop of its own: a slow, hanging or unreachable receiver
blocks one slot only. Several schedulers skip each other's claims."""

from __future__ import annotations

import asyncio
import threading
from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar
from uuid import UUID

import sqlalchemy as sa

from marey.core import metrics
from marey.core.errors import InvalidInput, Unreachable
from marey.db import transaction
from marey.runtime.logs import logger
from marey.scheduler.components import SchedulerComponent
from marey.scheduler.sending import Sender
from marey.webhooks import (
    Attempt,
    DeliveryState,
    DueDelivery,
    claim_deliveries,
    give_back_deliveries,
    record_attempt,
)
from marey.webhooks.message import headers_of, message_of
from marey.webhooks.vault import Vault

log = logger(__name__)

SLOTS = 64
"""Concurrent attempts; they wait for receivers, and compute nothing."""
EACH = 4
"""Concurrent attempts of one webhook."""
LOOKUPS = 16
"""Concurrent name look-ups."""
STOP_SECONDS = 5.0
"""Seconds for open attempts at shutdown; then they are released."""

OUTCOMES: dict[DeliveryState | None, str] = {
    DeliveryState.DELIVERED: "delivered",
    DeliveryState.PENDING: "retried",
    DeliveryState.FAILED: "failed",
    None: "lost",
}
"""Metric label of the state after an attempt; None = another process recorded the result."""

Given = TypeVar("Given")


class Deliverer(SchedulerComponent):
    """Claims deliveries every `interval` seconds, and whenever an attempt has ended, until `stopping`."""

    def __init__(
        self,
        engine: sa.Engine,
        vault: Vault,
        sender: Sender,
        *,
        api: str,
        interval: float,
        stopping: threading.Event,
    ) -> None:
        super().__init__("webhooks", pause=interval)
        self._engine = engine
        self._vault = vault
        self._sender = sender
        self._api = api
        self._interval = interval
        self._stopping = stopping
        self._database = ThreadPoolExecutor(2, "webhooks-database")  # separate from look-ups, which may hang
        self._under_way: dict[asyncio.Task[None], DueDelivery] = {}
        self._away = False

    def run(self) -> None:
        asyncio.run(self._loop())
        self._database.shutdown()

    async def _loop(self) -> None:
        asyncio.get_running_loop().set_default_executor(ThreadPoolExecutor(LOOKUPS, "webhooks-names"))
        while not self._stopping.is_set():
            self.progressed()
            try:
                for due in await self._blocking(self._claim):
                    self._under_way[asyncio.create_task(self._deliver(due))] = due
                self._away = False
                metrics.ROUNDS.labels(self.name, "done").inc()
            except Unreachable as error:
                if not self._away:
                    log.warning("webhooks_wait", error=error.message)
                self._away = True
                metrics.ROUNDS.labels(self.name, "waiting").inc()
            except Exception:
                metrics.ROUNDS.labels(self.name, "failed").inc()
                log.exception("webhooks_failed")
            await self._pause()
        await self._end()

    async def _pause(self) -> None:
        """Wait until an attempt has ended, or the next claim is due."""
        if self._under_way and not self._away:
            await asyncio.wait(self._under_way, timeout=self._interval, return_when=asyncio.FIRST_COMPLETED)
        else:
            await asyncio.sleep(self._interval)
        self._forget_ended()

    async def _end(self) -> None:
        if self._under_way:
            await asyncio.wait(self._under_way, timeout=STOP_SECONDS)
        self._forget_ended()
        left = dict(self._under_way)
        for task in left:
            task.cancel()
        if left:
            await asyncio.wait(left)
            try:
                await self._blocking(lambda: self._give_back(list(left.values())))
            except Unreachable as error:
                log.warning("webhooks_not_given_back", error=error.message)  # their claims expire

    def _forget_ended(self) -> None:
        for task in [task for task in self._under_way if task.done()]:
            del self._under_way[task]

    async def _deliver(self, due: DueDelivery) -> None:
        attempt = await self._try(due)
        try:
            state = await self._blocking(lambda: self._record(due, attempt))
        except Unreachable as error:
            log.warning("webhook_not_recorded", event_id=str(due.event), error=error.message)  # delivered again, later
        except Exception:
            log.exception("webhook_not_recorded", event_id=str(due.event))
        else:
            _note(due, attempt, state)

    async def _try(self, due: DueDelivery) -> Attempt:
        try:
            body = message_of(due, self._api)
            headers = headers_of(due, body, [self._vault.decrypt(each) for each in due.secrets])
            return await self._sender.send(due.url, headers, body)
        except InvalidInput as error:
            return Attempt(None, 0.0, str(error).splitlines()[0])
        except Exception:
            # It counts as an attempt: a message that causes an error here must not be retried every minute for ever.
            log.exception("webhook_failed", event_id=str(due.event))
            return Attempt(None, 0.0, "an internal error; the scheduler's log has its traceback")

    # --- in threads: the database is synchronous ---

    async def _blocking(self, act: Callable[[], Given]) -> Given:
        return await asyncio.get_running_loop().run_in_executor(self._database, act)

    def _claim(self) -> list[DueDelivery]:
        free = SLOTS - len(self._under_way)
        if free <= 0:
            return []
        busy: Counter[UUID] = Counter(due.webhook for due in self._under_way.values())
        with transaction(self._engine) as conn:
            return claim_deliveries(conn, free, each=EACH, busy=busy)

    def _record(self, due: DueDelivery, attempt: Attempt) -> DeliveryState | None:
        with transaction(self._engine) as conn:
            return record_attempt(conn, due, attempt)

    def _give_back(self, left: Sequence[DueDelivery]) -> None:
        with transaction(self._engine) as conn:
            give_back_deliveries(conn, left)


def _note(due: DueDelivery, attempt: Attempt, state: DeliveryState | None) -> None:
    metrics.WEBHOOK_SECONDS.observe(attempt.seconds)
    metrics.WEBHOOKS.labels(OUTCOMES[state]).inc()
    values = {"webhook": str(due.webhook), "event_id": str(due.event), "kind": due.kind, "status": attempt.status}
    if state is DeliveryState.DELIVERED:
        log.info("webhook_delivered", **values)
    else:
        log.warning("webhook_not_delivered", **values, error=attempt.error, state=state)
