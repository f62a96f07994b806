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
    """All of them, as written."""
    name: str | None = None
    """How the name begins, in any case."""
    text: str | None = None
    """Words of the prompt in any form and order; "a phrase", or, -not as on the web."""
    reviews: Sequence[Review] = ()
    """One of these."""
    unreviewed: bool = False
    """Or not looked at yet."""


@dataclass(frozen=True)
class Reroll:
    """Another take of a motion: an item in the same job."""

    motion: UUID
    item: UUID
    job: UUID
    seed: int
    state: ItemState
    made: bool
    """Now; else it was asked for before."""


@dataclass(frozen=True)
class GarbageReport:
    """Result of a garbage collection."""

    rows: int
    """Asset rows that nothing refers to, with their objects."""
    orphans: int
    """Objects without a row."""
    missing: tuple[str, ...]
    """Keys of rows whose object is not in the store: data loss, told, never hidden."""


@dataclass(frozen=True)
class Erasure:
    """A job whose prompts were erased."""

    job: UUID
    erased: datetime
    files_left: int
    """Files that are still to be written anew; nobody gets them before."""
