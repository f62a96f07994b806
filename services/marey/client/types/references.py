"""Results of `client.references`."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime

from marey.client.results import Result


@dataclass(frozen=True, kw_only=True)
class ReferenceMatch(Result):
    """An object that a short reference may mean."""

    kind: str = ""
    id: str
    name: str | None = None
    """The name; of a delivery, its event type."""
    state: str | None = None
    """The state; of a motion, its review."""
    created: datetime | None = None
    items: int | None = None
    """Number of items, of a job."""
    job: str | None = None
    """The job of a motion."""
    index: int | None = None
    """Position of the motion's prompt in the job, from 0."""
    variant: int | None = None
    """Number of the motion among those of its prompt, from 0."""


@dataclass(frozen=True, kw_only=True)
class Resolution(Result):
    """The objects that a short reference may mean."""

    matches: tuple[ReferenceMatch, ...] = ()
    """Newest first, at most 10. None: there is no such object. Several: the reference is ambiguous."""
