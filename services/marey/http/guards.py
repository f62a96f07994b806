"""ASGI middleware: which Host is answered, and what a proxy must pass on."""

from __future__ import annotations

from collections.abc import Sequence
from urllib.parse import urlsplit

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Receive, Scope, Send
from starlette.websockets import WebSocketClose

from marey.core.errors import MareyError, Refused, UpgradeMissing
from marey.core.origins import origin_of
from marey.http.problems import problem_response


class HostGuard:
    """Answers only requests for hosts it is known by: a web page that rebinds its name to this port gets nothing.

    A page of any origin may open a socket, unlike a request: browsers leave it to the server to check the page's
    origin. Allowed are pages of this server's own hosts and of the origins that may read its answers. Clients that are
    no browsers send no origin.
    """

    def __init__(self, app: ASGIApp, allowed: Sequence[str], origins: Sequence[str] = ()) -> None:
        self.app = app
        self.allowed = frozenset(host.lower() for host in allowed)
        self.origins = frozenset(origins)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on, or refuse."""
        error = self._objection(scope)
        if error is None:
            await self.app(scope, receive, send)
        else:
            await _refuse(error, scope, receive, send)

    def _objection(self, scope: Scope) -> MareyError | None:
        if scope["type"] not in ("http", "websocket"):
            return None
        headers = Headers(scope=scope)
        host = _without_port(headers.get("host", "")).lower()
        if host not in self.allowed and "*" not in self.allowed:
            return _foreign("this server does not answer for that host", host)
        origin = headers.get("origin")
        if scope["type"] != "websocket" or origin is None or origin_of(origin) in self.origins:
            return None
        own = _host_of(origin)
        if not own or own not in self.allowed | {host}:
            return _foreign("this server opens no sockets for pages of that origin", origin, "MAREY_CORS_ORIGINS")
        return None


class UpgradeGuard:
    """Refuse WebSocket handshakes that a proxy made ordinary requests: it drops `Upgrade` and `Connection`, which are
    between it and its client, and passes on the rest."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on, or refuse."""
        if scope["type"] == "http" and "sec-websocket-key" in Headers(scope=scope):
            error = UpgradeMissing(
                "the WebSocket arrived as an ordinary request: a proxy does not pass on the upgrade",
                hint="Let the proxy send HTTP/1.1 with the headers Upgrade and Connection: docs/how-to/proxy.md.",
            )
            await _refuse(error, scope, receive, send)
        else:
            await self.app(scope, receive, send)


def _without_port(host: str) -> str:
    return host.partition("]")[0] + "]" if host.startswith("[") else host.partition(":")[0]


def _host_of(origin: str) -> str:
    """The host of an `Origin`; empty for `null`, which is no host, and for what makes no sense."""
    try:
        return _without_port(urlsplit(origin).netloc).lower()
    except ValueError:
        return ""


def _foreign(message: str, where: str, setting: str = "MAREY_ALLOWED_HOSTS") -> Refused:
    return Refused(message, where=where[:100], hint=f"{setting} names those it does.")


async def _refuse(error: MareyError, scope: Scope, receive: Receive, send: Send) -> None:
    if scope["type"] == "websocket" and "websocket.http.response" not in scope.get("extensions", {}):
        await WebSocketClose()(scope, receive, send)
        return
    await problem_response(error)(scope, receive, send)
