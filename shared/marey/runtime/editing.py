"""Input of an edit: the stored motions that it is made from, independent of database and store."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from uuid import UUID

import sqlalchemy as sa

from marey.core.errors import NotFound
from marey.db import transaction
from marey.db.sql import among
from marey.exporters.registry import CANONICAL
from marey.jobs import Claim, MotionRow, asset_key, tables
from marey.jobs.motions import read_motions
from marey.storage import AssetStore


@dataclass(frozen=True)
class StoredSource:
    """A stored motion to edit.

    Attributes:
        sha256: of its npz.
        licence: of the motion.
    """

    sha256: str
    licence: str


@dataclass(frozen=True)
class EditInput:
    """Stored motions of the items of a claim.

    Attributes:
        sources: those that still exist, by id.
    """

    sources: Mapping[UUID, StoredSource]
    read: Callable[[str], bytes] = field(repr=False)
    """Reads content by sha256."""

    def source(self, motion: UUID) -> StoredSource:
        """Return a motion.

        Raises:
            NotFound: it was deleted, or has no npz.
        """
        found = self.sources.get(motion)
        if found is None:
            hint = "Edit another motion; this one cannot come back."
            raise NotFound("the motion to edit was deleted, or has no npz", where=f"motion {motion}", hint=hint)
        return found


def edit_input(engine: sa.Engine, store: AssetStore, claim: Claim) -> EditInput:
    """Return the motions that the items of a claim edit.

    Raises:
        Unreachable: the database does not answer.
    """
    wanted = {source for item in claim.items if item.edits is not None for source in item.edits.sources}
    table = tables.motion.c
    with transaction(engine) as conn:
        rows = read_motions(conn, (table.tenant_id == claim.tenant) & among(table.id, sorted(wanted)))
    return EditInput(
        sources={row.id: found for row in rows if (found := _stored(row)) is not None},
        read=lambda sha256: store.get(asset_key(claim.tenant, sha256)),
    )


def _stored(row: MotionRow) -> StoredSource | None:
    npz = row.file(CANONICAL)
    return None if npz is None else StoredSource(npz.sha256, row.licence)
