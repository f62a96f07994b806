"""Data types of the repositories of takes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any
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


@dataclass(frozen=True)
class NewRig:
    """A rig to add.

    Attributes:
        format: ending of the file's name, which tells how it is read.
        data: the file.
        map: names of the joints of some parts of the body; None = no map.
        report: what was found in it (`marey.motion.rigs.report.describe`).
    """

    tenant: str
    name: str
    format: str
    data: bytes = field(repr=False)
    map: Mapping[str, str | None] | None
    report: Mapping[str, Any] = field(repr=False)


@dataclass(frozen=True)
class RigRow:
    """A stored rig; `map` and `report` as in `NewRig`.

    Attributes:
        version: counts the changes of file and map, from 1.
        added_by: name of the key that added this version.
        created: time of the first version.
        updated: time of this version.
    """

    id: UUID
    name: str
    version: int
    format: str
    sha256: str
    size: int
    map: Mapping[str, str | None] | None
    report: Mapping[str, Any] = field(repr=False)
    added_by: str
    created: datetime
    updated: datetime


@dataclass(frozen=True)
class AddedRig:
    """A rig that was added; `changed` is False if it was there already with the same file and map."""

    rig: RigRow
    changed: bool
