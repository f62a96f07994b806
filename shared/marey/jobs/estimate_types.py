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
    """Number of measured motions."""
    seconds: float
    """Seconds of a worker per motion; parsing and writing files run in parallel."""
    since: datetime
    until: datetime


@dataclass(frozen=True)
class Estimate:
    """Expected duration of motions, excluding time in the queue."""

    items: int
    seconds: float | None
    """None = some of the bundles were not measured."""
    workers: Mapping[str, int]
    """Live workers, by model; at least one is assumed."""
    speeds: tuple[Speed, ...]
    unmeasured: tuple[str, ...]
    """Bundles without a recent motion."""


@dataclass(frozen=True)
class QueuePlace:
    """Position of a job in the queue."""

    state: JobState
    jobs_ahead: int
    """Jobs of the same tenant, with waiting items."""
    items_ahead: int
    tenants: int
    """Tenants with waiting items in the same queues, including this one: they take turns."""
    seconds: float | None
    """Seconds until it is done; None = it has ended or is paused, or its bundles were not measured."""
    estimate: Estimate
    """Estimate for its own open items."""
