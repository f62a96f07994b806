"""Web pages of other origins: CORS, and the origins that may open a socket."""

from __future__ import annotations

from collections.abc import Sequence

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from marey.core.errors import Refused
from marey.core.origins import origin_of
from marey.http.problems import problem_response

METHODS = "DELETE, GET, HEAD, PATCH, POST"
REQUEST_HEADERS = ", ".join(
    ("Authorization", "Content-Type", "Idempotency-Key", "If-None-Match", "If-Range", "Last-Event-ID", "Range")
)
ANSWER_HEADERS = ", ".join(
    (
        *("Accept-Ranges", "Content-Disposition", "Content-Range", "ETag", "Expires", "Idempotency-Replayed"),
        *("Location", "Retry-After"),
    )
)
MAX_AGE = 600
"""Seconds for which a browser caches a pre-flight."""


class OriginGuard:
    """Allows pages of the configured origins to read answers, and to send requests with an API key.

    The origin is named, never `*`, and cookies are not used: `Access-Control-Allow-Credentials` is not sent. A
    pre-flight is answered here, independent of the route, its key or its body, always with the same lists.
    """

    def __init__(self, app: ASGIApp, origins: Sequence[str]) -> None:
        self.app = app
        self.origins = frozenset(origins)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a pre-flight, or add CORS headers to the answer."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        origin = headers.get("origin", "")
        allowed = origin_of(origin) in self.origins
        if scope["method"] == "OPTIONS" and origin and "access-control-request-method" in headers:
            await _preflight(origin, allowed=allowed)(scope, receive, send)
            return

        async def with_origin(message: Message) -> None:
            if message["type"] == "http.response.start":
                answer = MutableHeaders(scope=message)
                answer.add_vary_header("Origin")
                if allowed:
                    answer["Access-Control-Allow-Origin"] = origin
                    answer["Access-Control-Expose-Headers"] = ANSWER_HEADERS
            await send(message)

        await self.app(scope, receive, with_origin)


def _preflight(origin: str, *, allowed: bool) -> Response:
    if not allowed:
        error = Refused("pages of this origin are not allowed", where=origin[:100], hint=HINT)
        response = problem_response(error)
    else:
        response = Response(status_code=204)
        response.headers["Access-Control-Allow-Origin"] = origin
        response.headers["Access-Control-Allow-Methods"] = METHODS
        response.headers["Access-Control-Allow-Headers"] = REQUEST_HEADERS
        response.headers["Access-Control-Max-Age"] = str(MAX_AGE)
    response.headers["Vary"] = "Origin"
    return response


HINT = "MAREY_CORS_ORIGINS lists the allowed ones."
