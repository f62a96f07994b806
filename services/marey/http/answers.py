"""Answers as middleware sees them pass."""

from __future__ import annotations

from starlette.types import Message, Scope, Send


class NotedAnswer:
    """Passes the messages of an answer on.

    Attributes:
        status: of the answer; 500 where none has begun.
    """

    def __init__(self, send: Send) -> None:
        self._send = send
        self.status = 500

    async def __call__(self, message: Message) -> None:
        """Pass a message on."""
        if message["type"] == "http.response.start":
            self.status = message["status"]
        await self._send(message)


def route_of(scope: Scope) -> str:
    """Return the route of a request, known once it was answered: with the names of its parameters."""
    return getattr(scope.get("route"), "path", "other")
