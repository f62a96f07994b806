"""Time estimates of the API: each number with its basis."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime
from typing import Any

import sqlalchemy as sa
from pydantic import Field

from marey.http.problems import QuotaBody
from marey.http.schemas import View
from marey.jobs import TEXT_QUEUE, Estimate, JobState, QueuePlace, Speed, estimate, waiting_items
from marey.tenants import check_quotas


class SpeedView(View):
    """Measured speed of a bundle on this platform."""

    bundle: str
    motions: int = Field(description="Number of measured motions, of the last 2,000.")
    seconds: float = Field(
        description="Seconds of a worker per motion, without parsing the prompt and writing the files."
    )
    since: datetime
    until: datetime

    @classmethod
    def of(cls, row: Speed) -> SpeedView:
        """Convert a row."""
        return cls(**vars(row))


class EstimateView(View):
    """Expected duration of motions, excluding time in the queue."""

    items: int
    seconds: float | None = Field(description="Null = some bundle was not measured.")
    workers: dict[str, int] = Field(description="Live workers, by model; at least one is assumed.")
    speeds: list[SpeedView]
    unmeasured: list[str] = Field(description="Bundles without a recent motion.")
    basis: str = Field(description="Basis of the estimate, or why there is none, for people.")

    @classmethod
    def of(cls, row: Estimate) -> EstimateView:
        """Convert a row."""
        return cls(
            items=row.items,
            seconds=row.seconds,
            workers=dict(row.workers),
            speeds=[SpeedView.of(speed) for speed in row.speeds],
            unmeasured=list(row.unmeasured),
            basis=basis_of(row),
        )


class QueueView(View):
    """Position of a job in the queue."""

    state: JobState
    jobs_ahead: int = Field(description="Jobs of the same tenant with waiting items: of higher priority, or older.")
    items_ahead: int
    tenants: int = Field(description="Tenants that wait for the same workers, including this one: they take turns.")
    seconds: float | None = Field(description="Seconds until it is done; null = ended, paused or not measured.")
    estimate: EstimateView = Field(description="Estimate for its own open items.")

    @classmethod
    def of(cls, row: QueuePlace) -> QueueView:
        """Convert a row."""
        own = {name: value for name, value in vars(row).items() if name != "estimate"}
        return cls(estimate=EstimateView.of(row.estimate), **own)


def basis_of(row: Estimate) -> str:
    """Describe the basis of an estimate, or why there is none."""
    if row.unmeasured:
        names = ", ".join(row.unmeasured)
        return f"no estimate: none of the last motions made here was made with {names}"
    if not row.speeds:
        return "nothing is left to make"
    parts = [
        f"{speed.seconds:.3g} s a motion, measured on the last {speed.motions} of {speed.bundle} "
        f"({speed.since:%Y-%m-%d %H:%M} to {speed.until:%Y-%m-%d %H:%M} UTC)"
        for speed in row.speeds
    ]
    workers = [
        f"{count} {name} worker{'s' if count > 1 else ''}" if count else f"no live {name} worker: one assumed"
        for name, count in row.workers.items()
    ]
    return "; ".join((*parts, *workers))


def check_capacity(
    conn: sa.Connection, tenant: str, by_bundle: Mapping[tuple[str, str], int], *, parsed: bool = True
) -> dict[str, Any]:
    """Return the estimate, the quotas and the waiting items for motions that could be submitted.

    Args:
        by_bundle: motions by model and exact bundle.
        parsed: their prompts go through the text queue.

    Raises:
        QuotaUsedUp: a quota is exhausted.
    """
    rooms, waiting = check_quotas(conn, tenant, sum(by_bundle.values())), waiting_items(conn)
    queues = {model for model, _ in by_bundle} | ({TEXT_QUEUE} if parsed else set())
    return {
        "estimate": EstimateView.of(estimate(conn, by_bundle)),
        "quotas": [QuotaBody.of(room) for room in rooms],
        "waiting": sum(waiting.get(queue, 0) for queue in queues),
    }
