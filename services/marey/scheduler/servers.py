"""Check that logs once when a server behind the scheduler is too old, or the database is not migrated."""

from __future__ import annotations

from collections.abc import Callable

import sqlalchemy as sa

from marey.core.errors import Conflict
from marey.db import check_revision
from marey.runtime.logs import logger
from marey.runtime.queue import check_queue

log = logger(__name__)

CHECK_SECONDS = 30.0


def server_check(engine: sa.Engine, queue_url: str) -> Callable[[], None]:
    """Return the action of a `Periodic`; it raises `Unreachable` while a server does not answer."""
    known: set[str] = set()

    def check() -> None:
        for one in (lambda: check_revision(engine), lambda: check_queue(queue_url)):
            try:
                one()
            except Conflict as error:
                if error.message not in known:
                    log.error("unsupported", where=error.where, error=error.message, hint=error.hint)
                known.add(error.message)

    return check
