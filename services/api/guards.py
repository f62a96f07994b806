"""ASGI middleware: which Host is answered, and how large a body may be."""

from __future__ import annotations

from collections.abc import Sequence
from urllib.parse import urlsplit

from starlette.datastructures import Headers
from starlette.requests import Request
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocketClose

from services.api.problems import problem_response
from shared.errors import InvalidInput, MareyError, Refused, TooLarge
from shared.items import MAX_BODY_BYTES

MAX_OTHER_BODY = 2**20
"""Bytes of any body but those that hold many prompts."""
PROMPTS_PATHS = ("/v1/jobs", "/v1/evaluations", "/v1/schedules")
"""Where such bodies go; their routes read them."""


class HostGuard:
    """Answers only requests for hosts it is known by: a web page that rebinds its name to this port gets nothing.

    A page of any host may open a socket, unlike a request: browsers leave it to the server to look at where the page is
    from. Who is no browser says nothing of that.
    """

    def __init__(self, app: ASGIApp, allowed: Sequence[str]) -> None:
        self.app = app
        self.allowed = frozenset(host.lower() for host in allowed)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on, or refuse."""
        error = self._objection(scope)
        if error is None:
            await self.app(scope, receive, send)
        else:
            await _refuse(error, scope, receive, send)

    def _objection(self, scope: Scope) -> Refused | None:
        if scope["type"] not in ("http", "websocket") or "*" in self.allowed:
            return None
        headers = Headers(scope=scope)
        host = _without_port(headers.get("host", "")).lower()
        if host not in self.allowed:
            return _foreign("this server does not answer for that host", host)
        origin = headers.get("origin")
        if scope["type"] == "websocket" and origin is not None and _host_of(origin) not in self.allowed:
            return _foreign("this server opens no sockets for pages of that host", origin)
        return None


class BodyGuard:
    """Reads bodies up to their limit before a route sees them; larger ones are refused. Routes that take many
    prompts read their own."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on with the whole body, or refuse."""
        if scope["type"] != "http" or _holds_prompts(scope):
            await self.app(scope, receive, send)
            return
        try:
            body = await read_body(Request(scope, receive), MAX_OTHER_BODY)
        except MareyError as error:
            await _refuse(error, scope, receive, send)
            return
        sent = False

        async def replay() -> Message:
            nonlocal sent
            if sent:
                return await receive()
            sent = True
            return {"type": "http.request", "body": body, "more_body": False}

        await self.app(scope, replay, send)


async def read_body(request: Request, limit: int) -> bytes:
    """The body of a request.

    Raises:
        TooLarge: over `limit` bytes; it is not read further.
        InvalidInput: the length it declares is not a number.
    """
    declared = request.headers.get("content-length", "0")
    if not declared.isdecimal():
        raise InvalidInput("is not a number", where="Content-Length")
    if int(declared) > limit:
        raise _too_large(limit)
    parts: list[bytes] = []
    size = 0
    async for part in request.stream():
        size += len(part)
        if size > limit:
            raise _too_large(limit)
        parts.append(part)
    return b"".join(parts)


def limit_of_submit() -> int:
    """Bytes of a body that holds many prompts."""
    return MAX_BODY_BYTES


def _holds_prompts(scope: Scope) -> bool:
    if scope["method"] == "PATCH":
        return scope["path"].startswith("/v1/schedules/")
    return scope["method"] == "POST" and scope["path"] in PROMPTS_PATHS


def _without_port(host: str) -> str:
    return host.partition("]")[0] + "]" if host.startswith("[") else host.partition(":")[0]


def _host_of(origin: str) -> str:
    """The host of an `Origin`; empty for `null`, which is no host, and for what makes no sense."""
    try:
        return _without_port(urlsplit(origin).netloc).lower()
    except ValueError:
        return ""


def _foreign(message: str, where: str) -> Refused:
    return Refused(message, where=where[:100], hint="MAREY_ALLOWED_HOSTS names those it does.")


def _too_large(limit: int) -> TooLarge:
    return TooLarge(f"the body is over {limit / 2**20:g} MiB", where="body", hint="Send it in several requests.")


async def _refuse(error: MareyError, scope: Scope, receive: Receive, send: Send) -> None:
    if scope["type"] == "websocket" and "websocket.http.response" not in scope.get("extensions", {}):
        await WebSocketClose()(scope, receive, send)
        return
    await problem_response(error)(scope, receive, send)
