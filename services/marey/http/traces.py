"""A span per request, in the trace of the caller or a new one; log lines carry its id."""

from __future__ import annotations

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Receive, Scope, Send

from marey.core import tracing
from marey.http.answers import NotedAnswer, route_of

UNTRACED = frozenset({"/livez", "/readyz", "/metrics"})
"""Paths that machines poll every few seconds."""


class Trace:
    """ASGI middleware that opens a span per request, named by its route once that is known."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Run the request inside a span."""
        if scope["type"] != "http" or scope["path"] in UNTRACED:
            await self.app(scope, receive, send)
            return
        parent = tracing.accepted(Headers(scope=scope).get(tracing.HEADER))
        with tracing.under(parent or (None if tracing.is_on() else tracing.made_up())):
            await self._answer(scope, receive, send)

    async def _answer(self, scope: Scope, receive: Receive, send: Send) -> None:
        noted = NotedAnswer(send)
        with tracing.span("request", kind="server") as span:
            try:
                await self.app(scope, receive, noted)
            finally:
                route = route_of(scope)
                span.rename(f"{scope['method']} {route}")
                named = {"http.request.method": scope["method"], "http.route": route}
                span.set(**named, **{"http.response.status_code": noted.status})
