"""Claim a batch, keep its lease, and know who works."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from uuid import UUID

import sqlalchemy as sa

from shared.jobs.policy import Policy
from shared.jobs.types import Claim, Heartbeat, WorkerBeat, WorkerRow


def claim(
    conn: sa.Connection,
    queue: str,
    worker: str,
    limit: int,
    *,
    prefer_batch_key: str | None = None,
    rules: Policy | None = None,
) -> Claim | None:
    """Take up to `limit` ready items of one lane under a new lease; None when there is nothing to do.

    The lane is that of the tenant with the smallest share running, then of the highest priority, then of the oldest
    job. With `prefer_batch_key` (the bundle and settings a worker has loaded) such a lane goes first until the one that
    is next in order has waited 30 s.
    """
    raise NotImplementedError


def heartbeat(
    conn: sa.Connection,
    lease_token: UUID,
    open_items: Collection[UUID],
    *,
    progressed: bool,
    rules: Policy | None = None,
) -> Heartbeat:
    """Renew a lease and read back what was taken away.

    Args:
        open_items: the items of the claim that are not committed, failed or released yet.
        progressed: the decode loop moved since the last heartbeat, or a bundle is being loaded or compiled. Without
            progress for 120 s the lease is not renewed.
    """
    raise NotImplementedError


def load_texts(conn: sa.Connection, keys: Sequence[str]) -> dict[str, bytes]:
    """The feature blobs of these keys, those that are known, in one query."""
    raise NotImplementedError


def waiting_batches(conn: sa.Connection, batch_sizes: Mapping[str, int]) -> dict[str, int]:
    """How many batches wait, by queue, where a batch of queue q holds `batch_sizes[q]` items. Only queues with some."""
    raise NotImplementedError


def beat(conn: sa.Connection, worker: WorkerBeat) -> None:
    """Note that a worker lives."""
    raise NotImplementedError


def retire(conn: sa.Connection, worker: str) -> None:
    """Forget a worker that stops in good order."""
    raise NotImplementedError


def live_workers(conn: sa.Connection, *, rules: Policy | None = None) -> dict[str, int]:
    """How many workers live, by queue."""
    raise NotImplementedError


def list_workers(conn: sa.Connection, *, rules: Policy | None = None) -> list[WorkerRow]:
    """Every worker seen within a day, newest heartbeat first."""
    raise NotImplementedError
