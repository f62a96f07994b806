"""Data types of time estimates and queue positions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime

from marey.jobs.states import JobState


@dataclass(frozen=True)
class Speed:
    """Measured speed of a bundle."""

    bundle: str
    motions: int
    """How many it was measured on."""
    seconds: float
    """Of a worker, for one motion; reading the prompt and writing the files go on beside it."""
    since: datetime
    until: datetime


@dataclass(frozen=True)
class Estimate:
    """Expected duration of motions, excluding time in the queue."""

    items: int
    seconds: float | None
    """None = some of their bundles were not measured."""
    workers: Mapping[str, int]
    """Those that live, by model; where none does, one is reckoned with."""
    speeds: tuple[Speed, ...]
    unmeasured: tuple[str, ...]
    """Bundles with which none of the last motions was made."""


@dataclass(frozen=True)
class QueuePlace:
    """Position of a job in the queue."""

    state: JobState
    jobs_ahead: int
    """Of the same tenant, with waiting items."""
    items_ahead: int
    tenants: int
    """With waiting items in the same queues, this one too: they take turns."""
    seconds: float | None
    """Until it is done; None = it has ended or is held, or nothing like it was measured."""
    estimate: Estimate
    """Of its own open items."""
