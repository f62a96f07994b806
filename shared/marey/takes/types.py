"""Data types of the repositories of takes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from uuid import UUID

from marey.jobs.states import ItemState, Review


@dataclass(frozen=True)
class MotionFilter:
    """Filter of a motion listing: all given conditions must match."""

    tags: Sequence[str] = ()
    """All of these tags."""
    name: str | None = None
    """Prefix of the name, case-insensitive."""
    text: str | None = None
    """Words of the prompt in any form and order; "a phrase", or, -not as in web search."""
    reviews: Sequence[Review] = ()
    """One of these verdicts."""
    unreviewed: bool = False
    """Or not reviewed yet."""


@dataclass(frozen=True)
class Reroll:
    """Another take of a motion: an item in the same job."""

    motion: UUID
    item: UUID
    job: UUID
    seed: int
    state: ItemState
    made: bool
    """True if created now; else it existed before."""


@dataclass(frozen=True)
class GarbageReport:
    """Result of a garbage collection."""

    rows: int
    """Unreferenced asset rows, with their objects."""
    orphans: int
    """Objects without a row."""
    missing: tuple[str, ...]
    """Keys of rows whose object is missing in the store: data loss, always reported."""


@dataclass(frozen=True)
class Erasure:
    """A job whose prompts were erased."""

    job: UUID
    erased: datetime
    files_left: int
    """Files that still wait to be rewritten, of edits too; they are not served before."""
    edits: tuple[UUID, ...] = ()
    """Jobs of edits of its motions; their prompts were erased with it."""
