"""Reads of motions with their files."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any
from uuid import UUID

import sqlalchemy as sa

from marey.core.errors import NotFound
from marey.db.sql import among
from marey.jobs import tables
from marey.jobs.files import files_of
from marey.jobs.states import Review
from marey.jobs.types import Edits, MotionFile, MotionRow
from marey.jobs.unmade import item_is, no_motion


def get_motion(conn: sa.Connection, tenant: str, motion: UUID) -> MotionRow:
    """Return one motion.

    Raises:
        NotFound: the tenant has no such motion.
    """
    return motions_of(conn, tenant, [motion])[0]


def motions_of(conn: sa.Connection, tenant: str, motions: Collection[UUID]) -> list[MotionRow]:
    """Return these motions, in the order given, without duplicates.

    Raises:
        NotFound: the tenant lacks one of them; of an item's id the error tells its state.
    """
    asked = list(dict.fromkeys(motions))
    rows = find_motions(conn, tenant, asked)
    missing = [motion for motion in asked if motion not in rows]
    if missing:
        error = missing_motion(conn, tenant, missing[0])
        if len(missing) > 1:
            error.message += f" (and {len(missing) - 1} more of those given are missing)"
        raise error
    return [rows[motion] for motion in asked]


def missing_motion(conn: sa.Connection, tenant: str, motion: UUID) -> NotFound:
    """Return the error about a motion that the tenant does not have; of an item's id it tells the state."""
    where = f"motion {motion}"
    found = no_motion(conn, tenant, item_is(motion), where=where)
    return found or NotFound("there is no such motion", where=where, hint="`marey motions list` shows yours.")


def find_motions(conn: sa.Connection, tenant: str, motions: Collection[UUID]) -> dict[UUID, MotionRow]:
    """Return those of these motions that the tenant has."""
    table = tables.motion.c
    return {row.id: row for row in read_motions(conn, (table.tenant_id == tenant) & among(table.id, list(motions)))}


def read_motions(
    conn: sa.Connection,
    wanted: sa.ColumnElement[bool],
) -> list[MotionRow]:
    """Return motions with their files, unordered, in two queries."""
    rows = conn.execute(_MOTIONS.where(wanted)).mappings().all()
    file = tables.motion_file.c
    files = files_of(conn, file.motion_id, [row["id"] for row in rows], MotionFile, ~file.erasing)
    return [_motion(row, files[row["id"]]) for row in rows]


def _all_motions() -> sa.Select[*tuple[Any, ...]]:
    """Return the query of all motions with their items."""
    motion, item = tables.motion.c, tables.item.c
    later = tables.item.alias("later")
    return (
        sa.select(
            *(motion.id, motion.tenant_id.label("tenant"), motion.job_id.label("job"), motion.item_id.label("item")),
            *(item.name, item.prompt, item.model, item.bundle, motion.licence, item.seed, item.variant),
            *(motion.frames, motion.fps, motion.elapsed, motion.metadata.label("metadata")),
            motion.created_at.label("created"),
            *(item.index, item.tags, item.replaces, item.edits, later.c.id.label("replaced_by")),
            *(motion.review, motion.reviewed_at.label("reviewed"), motion.reviewed_by, motion.review_comment),
        )
        .join(tables.item, item.id == motion.item_id)
        .outerjoin(later, later.c.replaces == motion.id)
    )


_MOTIONS = _all_motions()
"""Built once: the columns of its alias take a quarter of a request for one motion."""


def _motion(row: sa.RowMapping, files: Sequence[MotionFile]) -> MotionRow:
    values: dict[str, Any] = dict(row)
    review, edits = row["review"], Edits.of(values.pop("edits"))
    values.update(
        tags=tuple(row["tags"]),
        review=None if review is None else Review(review),
        edited_from=() if edits is None else edits.sources,
    )
    return MotionRow(**values, files=tuple(files))
