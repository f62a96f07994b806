"""The checks of `/readyz`. To add one, add an entry to `readiness_checks`."""

from __future__ import annotations

import sqlalchemy as sa

from marey.api.readiness import DependencyCheck
from marey.core.errors import Unreachable
from marey.core.settings import Settings
from marey.db import check_revision, transaction
from marey.jobs import EDIT_QUEUE, EVALUATOR_QUEUE, TEXT_QUEUE, list_schedulers, list_workers
from marey.runtime.queue import check_queue
from marey.storage import AssetStore

WITHOUT_MODEL = frozenset({TEXT_QUEUE, EDIT_QUEUE, EVALUATOR_QUEUE})
"""Queues whose workers generate nothing."""


def readiness_checks(config: Settings, engine: sa.Engine, store: AssetStore) -> dict[str, DependencyCheck]:
    """Return the checks of an API process, by the name that `/readyz` shows."""
    return {
        "database": DependencyCheck(
            lambda: check_revision(engine), "the database does not answer, or it or its tables are too old"
        ),
        "queue": DependencyCheck(lambda: _check_queue(config), "the queue does not answer, or is too old"),
        "store": DependencyCheck(store.check, "the asset store does not answer"),
        "model": DependencyCheck(ModelCheck(engine), "no worker has its model loaded yet"),
        # Submits and reads work without a scheduler, so a load balancer must not remove this API.
        "scheduler": DependencyCheck(
            lambda: _check_scheduler(engine), "the scheduler stalls or was killed", required=False
        ),
    }


class ModelCheck:
    """Require a generator worker with its model loaded, once: later jobs wait in the queue for a worker to return."""

    def __init__(self, engine: sa.Engine) -> None:
        self._engine = engine
        self._seen = False

    def __call__(self) -> None:
        """Run the check.

        Raises:
            Unreachable: no such worker has been seen yet.
        """
        if self._seen:
            return
        with transaction(self._engine) as conn:
            workers = list_workers(conn)
        if not any(w.live and w.bundle is not None and w.queue not in WITHOUT_MODEL for w in workers):
            raise Unreachable("no worker has its model loaded yet")
        self._seen = True


def _check_queue(config: Settings) -> None:
    url = config.queue_url
    if url is None:
        raise Unreachable("no queue is configured", hint="Set MAREY_QUEUE_URL.")
    check_queue(url.get_secret_value())


def _check_scheduler(engine: sa.Engine) -> None:
    """Require recent progress of a known scheduler. Passes if none was ever seen: it may start later."""
    with transaction(engine) as conn:
        known = list_schedulers(conn)
    if known and not known[0].live:
        raise Unreachable(f"no scheduler has made progress for {known[0].silence:.0f} s")
