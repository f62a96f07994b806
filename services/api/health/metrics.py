"""What Prometheus reads."""

from __future__ import annotations

import time

import sqlalchemy as sa
from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, generate_latest
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from shared.jobs import live_workers, transaction, waiting_items

REGISTRY = CollectorRegistry()
REQUESTS = Counter("marey_http_requests", "Answered requests.", ("method", "route", "status"), registry=REGISTRY)
SECONDS = Histogram("marey_http_seconds", "Time to the end of an answer.", ("method", "route"), registry=REGISTRY)
WAITING = Gauge("marey_waiting_items", "Ready items, by queue.", ("queue",), registry=REGISTRY)
WORKERS = Gauge("marey_live_workers", "Workers seen lately, by queue.", ("queue",), registry=REGISTRY)


def render(engine: sa.Engine) -> bytes:
    """The text exposition, with the queues as they stand.

    Raises:
        Unreachable: the database does not answer.
    """
    with transaction(engine) as conn:
        waiting, workers = waiting_items(conn), live_workers(conn)
    for gauge, values in ((WAITING, waiting), (WORKERS, workers)):
        gauge.clear()
        for queue, value in values.items():
            gauge.labels(queue).set(value)
    return generate_latest(REGISTRY)


class Measure:
    """ASGI middleware: counts and times requests by route, not by path."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on and measure."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        began = time.perf_counter()
        status = 500

        async def noted(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
            await send(message)

        try:
            await self.app(scope, receive, noted)
        finally:
            route = getattr(scope.get("route"), "path", "other")
            REQUESTS.labels(scope["method"], route, str(status)).inc()
            SECONDS.labels(scope["method"], route).observe(time.perf_counter() - began)
