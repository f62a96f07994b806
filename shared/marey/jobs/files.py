"""Files of motions and of reports: rows that join an owner to assets by format."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from typing import TypeVar
from uuid import UUID

import sqlalchemy as sa

from marey.db.sql import among
from marey.jobs import tables

F = TypeVar("F")


def asset_key(tenant: str, sha256: str) -> str:
    """Return the key of an asset in the store: `t/{tenant}/{sha[:2]}/{sha}`."""
    return f"t/{tenant}/{sha256[:2]}/{sha256}"


def files_of(
    conn: sa.Connection,
    owner: sa.Column[UUID],
    owners: Sequence[UUID],
    kind: Callable[[str, str, int, str], F],
    *where: sa.ColumnElement[bool],
) -> defaultdict[UUID, list[F]]:
    """Return the files of each owner by format, in one query.

    Args:
        owner: the column that names the owner, in a table with `format` and `asset_id`.
        owners: ids of the owners.
        kind: constructor of a file from format, sha256, size and media type.
        where: condition on the files.
    """
    file, asset = owner.table.c, tables.asset.c
    query = (
        sa.select(owner, file.format, asset.sha256, asset.size, asset.media_type)
        .join(tables.asset, asset.id == file.asset_id)
        .where(among(owner, owners), *where)
        .order_by(file.format)
    )
    found: defaultdict[UUID, list[F]] = defaultdict(list)
    for each, *values in conn.execute(query):
        found[each].append(kind(*values))
    return found
