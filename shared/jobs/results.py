"""Writes under a lease: every one is fenced by the lease token, the first committed result wins."""

from __future__ import annotations

from collections.abc import Sequence
from uuid import UUID

import sqlalchemy as sa

from shared.jobs.policy import Policy
from shared.jobs.types import AssetDigest, Committed, ItemFailure, NewMotion, NewText


def begin_assets(conn: sa.Connection, lease_token: UUID, assets: Sequence[AssetDigest]) -> bool:
    """Announce what is about to be PUT (rows `writing`), in a transaction of its own before the PUT.

    Returns:
        False when the lease is gone: put nothing.
    """
    raise NotImplementedError


def commit_motions(conn: sa.Connection, lease_token: UUID, motions: Sequence[NewMotion]) -> Committed:
    """Finish items: assets stored, motions, counters and one progress event in this transaction.

    The files must lie in the asset store and have been announced by `begin_assets`.
    """
    raise NotImplementedError


def commit_texts(conn: sa.Connection, lease_token: UUID, texts: Sequence[NewText]) -> Committed:
    """Store text features and send their items on to the stage `generate`.

    Ready items of the same job with the same key go with them.
    """
    raise NotImplementedError


def fail_items(
    conn: sa.Connection, lease_token: UUID, failures: Sequence[ItemFailure], *, rules: Policy | None = None
) -> Committed:
    """Record errors: permanent ones end the item `failed`; retryable ones cost an attempt and come back after a delay,
    or end it `dead` when the attempts are used up."""
    raise NotImplementedError


def release(conn: sa.Connection, lease_token: UUID, reason: str, items: Sequence[UUID] | None = None) -> Committed:
    """Give items back (all of the lease, by default), at no cost of an attempt: SIGTERM, a store or database outage."""
    raise NotImplementedError
