"""Idempotency keys: a repeated request returns the result of the first one, for 24 hours."""

from __future__ import annotations

from typing import Any, Literal
from uuid import UUID

import sqlalchemy as sa
from sqlalchemy.dialects.postgresql import insert

from marey.core.errors import InvalidInput
from marey.db.sql import CLOCK, interval
from marey.jobs import tables
from marey.jobs.errors import IdempotencyMismatch
from marey.jobs.policy import policy

Owner = Literal["job_id", "evaluation_id"]


def take_key(
    conn: sa.Connection, tenant: str, key: str | None, body_sha256: str | None, owner: Owner, identifier: UUID
) -> UUID | None:
    """Register a key for a new object, or return the object that has it. Waits for a concurrent request with the key.

    Args:
        key: None = the request has none.
        body_sha256: digest of the request; digests of different kinds of requests differ.
        owner: kind of the new object.
        identifier: its id; its row has to exist when the transaction commits.

    Returns:
        the id of the object of an earlier request with this key; None = proceed.

    Raises:
        InvalidInput: a key without digest.
        IdempotencyMismatch: the key was used with another request.
    """
    if key is None:
        return None
    if body_sha256 is None:
        raise InvalidInput("an idempotency key needs the digest of the body", where="body_sha256")
    table = tables.idempotency
    values = {
        "body_sha256": body_sha256,
        "job_id": None,
        "evaluation_id": None,
        owner: identifier,
        "created_at": CLOCK,
    }
    forgotten = table.c.created_at < CLOCK - interval(policy().idempotency)  # as in `find_key`
    ours = conn.execute(
        insert(table)
        .values(tenant_id=tenant, key=key, **values)
        .on_conflict_do_update(index_elements=["tenant_id", "key"], set_=values, where=forgotten)
        .returning(table.c.key)
    ).one_or_none()
    if ours is not None:
        return None
    return _made(conn.execute(_earlier(tenant, key, owner)).one(), key, body_sha256)


def find_key(conn: sa.Connection, tenant: str, key: str | None, body_sha256: str | None, owner: Owner) -> UUID | None:
    """Return the object of an earlier request with a key, and register nothing: what a request names may be gone when
    it is repeated.

    Args:
        key, body_sha256, owner: as `take_key`.

    Raises:
        IdempotencyMismatch: as `take_key`.
    """
    if key is None:
        return None
    fresh = tables.idempotency.c.created_at >= CLOCK - interval(policy().idempotency)
    earlier = conn.execute(_earlier(tenant, key, owner).where(fresh)).one_or_none()
    return None if earlier is None else _made(earlier, key, body_sha256)


def _earlier(tenant: str, key: str, owner: Owner) -> sa.Select[Any, Any]:
    table = tables.idempotency.c
    return sa.select(table.body_sha256, table[owner].label("made")).where(table.tenant_id == tenant, table.key == key)


def _made(earlier: sa.Row[Any, Any], key: str, body_sha256: str | None) -> UUID:
    if earlier.body_sha256 != body_sha256 or earlier.made is None:
        raise IdempotencyMismatch(
            "this idempotency key was used with another body",
            where=f"idempotency key {key}",
            hint="Use a new key for a new request.",
        )
    return earlier.made
