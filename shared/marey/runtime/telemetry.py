"""A claim as those see it who watch: its span in the trace of its job, its numbers, the names in its log lines."""

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
"""Items named in one attribute or line; a claim holds no more."""


class ClaimTelemetry:
    """What is done for one claim, from `claimed` to the last write; on the loop's thread and the committer's."""

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
        """What happens inside is done for this claim: log lines and spans say so, whoever writes them."""
        names = {"job": str(self.claim.job), "lease": str(self.claim.lease_token), "queue": self.claim.queue}
        with bound_contextvars(**names), tracing.under(self.span.traceparent):
            yield

    @contextmanager
    def stage(self, name: str, *, item: UUID | None = None, items: Iterable[UUID] = ()) -> Generator[Span]:
        """A stage of it, timed however it ends; for one item, or for some."""
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
        """The claim itself, which is over before anybody knows whose it is."""
        tracing.begin("claim", parent=self.span.traceparent, ago=seconds, job=str(self.claim.job)).end()
        self._observe("claim", seconds)
        metrics.BATCH_ITEMS.labels(self.claim.queue).observe(len(self.claim.items))

    def wrote(self, states: Iterable[str], *, lost: int = 0) -> None:
        """Items went to these states; `lost` results nobody wanted."""
        for state in states:
            metrics.ITEMS.labels(self.claim.queue, state).inc()
        if lost:
            metrics.THROWN_AWAY.labels(self.claim.queue).inc(lost)

    def outage(self) -> None:
        """Something that it needs is away; its items go back uncounted."""
        metrics.OUTAGES.labels(self.claim.queue).inc()

    def end(self) -> None:
        """Every item of it is written, or was given up."""
        self.span.end()

    def _observe(self, stage: str, seconds: float) -> None:
        metrics.STAGE_SECONDS.labels(self.claim.queue, stage).observe(seconds)


def ids_of(items: Iterable[UUID]) -> list[str]:
    """Identifiers for a log line."""
    return [str(item) for item in items][:MOST_IDS]
