"""An API with bundles to evaluate, and the scheduler and the worker beside it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from uuid import UUID

import httpx2
import sqlalchemy as sa

from marey.core.settings import Settings
from marey.db import transaction
from marey.evaluations import tables as evaluation_tables
from marey.scheduler.evaluations import EvaluationScheduler
from marey.tenants import create_key
from marey.tenants import tables as tenant_tables
from tests.support.evaluations import ToyEvaluator, write_evaluator, write_generator
from tests.support.live_api import LiveApi, running_api, settings_of
from tests.support.runtime import Loop
from tests.support.toy import ToyHandler, ToyTextHandler


@dataclass
class Studio:
    """A server with its scheduler and its worker, both of which move when told."""

    api: LiveApi
    config: Settings
    judge: ToyEvaluator
    scheduler: EvaluationScheduler
    loop: Loop

    def work(self) -> None:
        """Scheduler and worker take everything as far as it goes."""
        for _ in range(3):
            self.scheduler.round()
            while self.loop.run():
                pass
        self.scheduler.round()

    def key(self, *scopes: str, tenant: str = "default") -> str:
        """A key with these scopes."""
        with transaction(self.api.engine) as conn:
            known = conn.execute(
                sa.select(tenant_tables.tenant.c.id).where(tenant_tables.tenant.c.id == tenant)
            ).one_or_none()
            if known is None:
                conn.execute(sa.insert(tenant_tables.tenant).values(id=tenant))
            return create_key(conn, tenant, scopes, tenant=tenant).secret

    def http(self, *scopes: str, tenant: str = "default") -> httpx2.Client:
        """A client whose key has these scopes."""
        key = self.key(*scopes, tenant=tenant)
        return httpx2.Client(base_url=self.api.url, headers={"Authorization": f"Bearer {key}"}, timeout=30)

    def make_due(self, schedule: str) -> None:
        """As if a schedule's time had come."""
        with transaction(self.api.engine) as conn:
            table = evaluation_tables.schedule
            due = sa.update(table).where(table.c.id == UUID(schedule)).values(next_at=sa.text("now()"))
            conn.execute(due)


@contextmanager
def studio(home: Path, database_url: str, queue_url: str) -> Iterator[Studio]:
    """A studio until the end of the block."""
    config = settings_of(home, database_url, queue_url)
    write_generator(config.models)
    write_evaluator(config.models)
    judge = ToyEvaluator()
    with running_api(config, database_url) as api:
        loop = Loop(api.engine, api.store, ToyTextHandler(), ToyHandler(), judge)
        try:
            yield Studio(api, config, judge, EvaluationScheduler(api.engine, config), loop)
        finally:
            loop.close()
