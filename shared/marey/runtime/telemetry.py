"""Telemetry of a claim: its span in the trace of its job, its metrics, and the ids in its log lines."""

from __future__ import annotations

import time
from collections.abc import Generator, Iterable
from contextlib import contextmanager
from uuid import UUID

from structlog.contextvars import bound_contextvars

from marey.core import metrics, tracing
from marey.core.tracing import Span
from marey.jobs import Claim

MOST_IDS = 64
"""Maximum ids in one attribute or line; a claim holds no more."""


class ClaimTelemetry:
    """Telemetry of one claim, from `claimed` to the last write; used by the loop's thread and the committer's."""

    def __init__(self, claim: Claim) -> None:
        self.claim = claim
        self.span = tracing.begin(
            f"{claim.queue} batch",
            parent=claim.traceparent,
            kind="consumer",
            job=str(claim.job),
            lease=str(claim.lease_token),
            tenant=claim.tenant,
            queue=claim.queue,
            bundle=claim.bundle,
            items=len(claim.items),
        )

    @contextmanager
    def bound(self) -> Generator[None]:
        """Bind log lines and spans of a block to this claim."""
        names = {"job": str(self.claim.job), "lease": str(self.claim.lease_token), "queue": self.claim.queue}
        with bound_contextvars(**names), tracing.under(self.span.traceparent):
            yield

    @contextmanager
    def stage(self, name: str, *, item: UUID | None = None, items: Iterable[UUID] = ()) -> Generator[Span]:
        """Time a stage of the claim, however it ends; for one item, or for some."""
        began = time.perf_counter()
        ids = ids_of(items) if item is None else [str(item)]
        try:
            with tracing.span(name, parent=self.span.traceparent, job=str(self.claim.job)) as span:
                if ids:
                    span.set(items=len(ids), item=",".join(ids))
                yield span
        finally:
            self._observe(name, time.perf_counter() - began)

    def claimed(self, seconds: float) -> None:
        """Record the claim itself, which ends before its job is known."""
        tracing.begin("claim", parent=self.span.traceparent, ago=seconds, job=str(self.claim.job)).end()
        self._observe("claim", seconds)
        metrics.BATCH_ITEMS.labels(self.claim.queue).observe(len(self.claim.items))

    def wrote(self, states: Iterable[str], *, lost: int = 0) -> None:
        """Count items by their new states, and `lost` discarded results."""
        for state in states:
            metrics.ITEMS.labels(self.claim.queue, state).inc()
        if lost:
            metrics.THROWN_AWAY.labels(self.claim.queue).inc(lost)

    def outage(self) -> None:
        """Record an outage of a dependency; the claim's items are released uncounted."""
        metrics.OUTAGES.labels(self.claim.queue).inc()

    def end(self) -> None:
        """End the span: every item is written or given up."""
        self.span.end()

    def _observe(self, stage: str, seconds: float) -> None:
        metrics.STAGE_SECONDS.labels(self.claim.queue, stage).observe(seconds)


def ids_of(items: Iterable[UUID]) -> list[str]:
    """Return identifiers for a log line."""
    return [str(item) for item in items][:MOST_IDS]
