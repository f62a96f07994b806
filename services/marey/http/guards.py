"""ASGI middleware that checks the Host header and the headers of WebSocket upgrades."""

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
    """Answers only requests for configured hosts: a web page that rebinds its name to this port gets no access.

    Unlike a request, a socket may be opened by a page of any origin: browsers leave it to the server to check the
    origin. Allowed are pages of this server's own hosts and of the configured origins. Clients other than
    browsers send no origin.
    """

    def __init__(self, app: ASGIApp, allowed: Sequence[str], origins: Sequence[str] = ()) -> None:
        self.app = app
        self.allowed = frozenset(host.lower() for host in allowed)
        self.origins = frozenset(origins)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on, or refuse it."""
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
            return _foreign("this server does not serve that host", host)
        origin = headers.get("origin")
        if scope["type"] != "websocket" or origin is None or origin_of(origin) in self.origins:
            return None
        own = _host_of(origin)
        if not own or own not in self.allowed | {host}:
            return _foreign("pages of that origin may not open sockets", origin, "MAREY_CORS_ORIGINS")
        return None


class UpgradeGuard:
    """Refuses WebSocket handshakes that a proxy forwarded as ordinary requests, without `Upgrade` and `Connection`."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on, or refuse it."""
        if scope["type"] == "http" and "sec-websocket-key" in Headers(scope=scope):
            error = UpgradeMissing(
                "the WebSocket arrived as an ordinary request: a proxy does not forward the upgrade",
                hint="Let the proxy send HTTP/1.1 with the headers Upgrade and Connection: docs/how-to/proxy.md.",
            )
            await _refuse(error, scope, receive, send)
        else:
            await self.app(scope, receive, send)


def _without_port(host: str) -> str:
    return host.partition("]")[0] + "]" if host.startswith("[") else host.partition(":")[0]


def _host_of(origin: str) -> str:
    """Return the host of an `Origin`; empty for `null` and for invalid origins."""
    try:
        return _without_port(urlsplit(origin).netloc).lower()
    except ValueError:
        return ""


def _foreign(message: str, where: str, setting: str = "MAREY_ALLOWED_HOSTS") -> Refused:
    return Refused(message, where=where[:100], hint=f"{setting} lists the allowed ones.")


async def _refuse(error: MareyError, scope: Scope, receive: Receive, send: Send) -> None:
    if scope["type"] == "websocket" and "websocket.http.response" not in scope.get("extensions", {}):
        await WebSocketClose()(scope, receive, send)
        return
    await problem_response(error)(scope, receive, send)
