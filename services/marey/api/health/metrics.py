"""Prometheus metrics of the API: its own requests, and the queues in the database."""

from __future__ import annotations

import threading
import time
from collections import defaultdict
from collections.abc import Iterable, Mapping

import sqlalchemy as sa
from prometheus_client import Gauge, generate_latest
from starlette.types import ASGIApp, Receive, Scope, Send

from marey.core import metrics
from marey.core.metrics import MAX_TENANTS, OTHER_TENANTS
from marey.db import SEARCH, transaction
from marey.http.answers import NotedAnswer, route_of
from marey.jobs import (
    Outbox,
    QueueDepth,
    list_schedulers,
    live_workers,
    open_stream_counts,
    outbox_state,
    queue_depths,
)

METHODS = frozenset({"GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS"})
"""Other methods are counted as `other`: a client may invent any number of them."""
_rendering = threading.Lock()


def render(engine: sa.Engine) -> bytes:
    """Return the text exposition, with current queue figures.

    Raises:
        Unreachable: the database does not answer.
    """
    with transaction(engine, SEARCH) as conn:
        depths, workers = queue_depths(conn), live_workers(conn)
        streams, outbox = open_stream_counts(conn), outbox_state(conn)
        schedulers = {row.host: row.silence for row in reversed(list_schedulers(conn))}
    with _rendering:  # two concurrent scrapes would clear each other's gauges
        _show_queues(bounded(depths))
        _show(metrics.WORKERS, workers)
        _show(metrics.SCHEDULERS, schedulers)
        _show(metrics.STREAMS, streams)
        _show_outbox(outbox)
        return generate_latest(metrics.API)


def bounded(depths: Iterable[QueueDepth], limit: int = MAX_TENANTS) -> list[QueueDepth]:
    """Limit depths to `limit` tenants by name, those with the most items; the others are summed up by queue."""
    rows = list(depths)
    sizes: defaultdict[str, int] = defaultdict(int)
    for row in rows:
        sizes[row.tenant] += row.waiting + row.running
    named = set(sorted(sizes, key=lambda tenant: (-sizes[tenant], tenant))[:limit])
    others: dict[str, QueueDepth] = {}
    for row in rows:
        if row.tenant not in named:
            sofar = others.get(row.queue, QueueDepth(row.queue, OTHER_TENANTS, 0, 0, 0.0, 0.0))
            others[row.queue] = QueueDepth(
                row.queue,
                OTHER_TENANTS,
                sofar.waiting + row.waiting,
                sofar.running + row.running,
                max(sofar.oldest, row.oldest),
                max(sofar.unserved, row.unserved),
            )
    return [*(row for row in rows if row.tenant in named), *others.values()]


def _show_queues(depths: Iterable[QueueDepth]) -> None:
    for gauge in (metrics.WAITING, metrics.RUNNING, metrics.OLDEST, metrics.UNSERVED):
        gauge.clear()
    for row in depths:
        metrics.WAITING.labels(row.queue, row.tenant).set(row.waiting)
        metrics.RUNNING.labels(row.queue, row.tenant).set(row.running)
        if row.waiting:
            metrics.OLDEST.labels(row.queue, row.tenant).set(row.oldest)
            metrics.UNSERVED.labels(row.queue, row.tenant).set(row.unserved)


def _show(gauge: Gauge, values: Mapping[str, float]) -> None:
    gauge.clear()
    for label, value in values.items():
        gauge.labels(label).set(value)


def _show_outbox(outbox: Outbox) -> None:
    metrics.WEBHOOKS_PENDING.set(outbox.pending)
    metrics.WEBHOOKS_OVERDUE.set(outbox.overdue)


class Measure:
    """ASGI middleware that counts and times requests by route, not by path."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on and measure."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        began, noted = time.perf_counter(), NotedAnswer(send)
        try:
            await self.app(scope, receive, noted)
        finally:
            route = route_of(scope)
            method = scope["method"] if scope["method"] in METHODS else "other"
            metrics.HTTP_REQUESTS.labels(method, route, str(noted.status)).inc()
            metrics.HTTP_SECONDS.labels(method, route).observe(time.perf_counter() - began)
