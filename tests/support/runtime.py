"""The claim loop of one worker child inside the test's process, on real Postgres and a real store."""

from __future__ import annotations

import threading
from collections.abc import Collection
from uuid import UUID

import sqlalchemy as sa

from marey.db import transaction
from marey.jobs import HeartbeatReply, Policy, heartbeat
from marey.runtime.committer import Committer
from marey.runtime.handler import Handler
from marey.runtime.lease import Heartbeat
from marey.runtime.loop import Drain
from marey.storage import AssetStore


class Loop:
    """Heartbeat, committer and drain around one handler; `close` ends the threads."""

    def __init__(
        self,
        engine: sa.Engine,
        store: AssetStore,
        *handlers: Handler,
        interval: float = 0.1,
        rules: Policy | None = None,
    ) -> None:
        self.engine = engine
        self.rules = rules
        self.stopping = threading.Event()
        self.ticks = 0
        self.heartbeat = Heartbeat(self._renew, interval=interval, stopping=self.stopping)
        self.committer = Committer(engine, store, self.heartbeat, self.stopping)
        self.drain = Drain(
            engine,
            lambda queue: f"test/{queue}",
            {handler.queue: handler for handler in handlers},
            heartbeat=self.heartbeat,
            committer=self.committer,
            store=store,
            stopping=self.stopping,
            ticked=self._tick,
        )
        self.heartbeat.start()
        self.committer.start()

    def run(self, seconds: float = 60.0) -> int:
        """One drain."""
        return self.drain.drain(seconds)

    def close(self) -> None:
        """End the threads, and wait until they have."""
        self.stopping.set()
        self.heartbeat.close()
        self.committer.close()
        self.heartbeat.join(10.0)
        self.committer.join(10.0)

    def _tick(self) -> None:
        self.ticks += 1

    def _renew(self, token: UUID, items: Collection[UUID], progressed: bool) -> HeartbeatReply:
        with transaction(self.engine) as conn:
            return heartbeat(conn, token, items, progressed=progressed, rules=self.rules)
