"""Content that is written without a lease: rewritten files, and files made on request."""

from __future__ import annotations

import hashlib
from typing import Protocol
from uuid import UUID

import sqlalchemy as sa
from sqlalchemy.dialects.postgresql import insert

from marey.db.database import transaction
from marey.db.deadlines import MAINTENANCE
from marey.db.ids import new_id
from marey.db.sql import CLOCK
from marey.jobs import tables
from marey.jobs.files import asset_key


class ContentStore(Protocol):
    """Methods of an asset store that writing needs (`marey.storage.AssetStore` fits)."""

    def put(self, key: str, source: bytes) -> object: ...


def write_content(engine: sa.Engine, store: ContentStore, tenant: str, data: bytes, media_type: str) -> str:
    """Announce content, write it, and return its sha256; `keep_content` and a reference make it stay.

    Raises:
        Unreachable: the store or the database does not answer.
    """
    sha256 = hashlib.sha256(data).hexdigest()
    values = {"tenant_id": tenant, "sha256": sha256, "size": len(data), "media_type": media_type}
    with transaction(engine, MAINTENANCE) as conn:
        announced = insert(tables.asset).values(id=new_id(), state="writing", announced_at=CLOCK, **values)
        conn.execute(
            announced.on_conflict_do_update(index_elements=["tenant_id", "sha256"], set_={"announced_at": CLOCK})
        )
    store.put(asset_key(tenant, sha256), data)
    return sha256


def keep_content(conn: sa.Connection, tenant: str, sha256: str) -> UUID | None:
    """Mark content as stored and return its asset, which this transaction has to refer to; None if the garbage
    collector interfered: then it is to be written again."""
    table = tables.asset.c
    return conn.execute(
        sa.update(tables.asset)
        .where(table.tenant_id == tenant, table.sha256 == sha256)
        .values(state="stored")
        .returning(table.id)
    ).scalar_one_or_none()
