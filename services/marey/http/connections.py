"""HTTP connections with a time limit for the head of a request, and with problems as answers to what is no request."""

from __future__ import annotations

import asyncio
from typing import Any

import h11
from uvicorn.protocols.http.h11_impl import STATUS_PHRASES, H11Protocol

from marey.core.errors import MalformedRequest, MareyError, TooSlow
from marey.core.settings import Settings
from marey.http.problems import problem_response

MAX_HEAD = 2**16
"""Bytes of the first line and the headers of a request."""


class LimitedConnection(h11.Connection):
    """h11's connection that refuses a head over `MAX_HEAD` bytes, whole heads too: h11 has a limit only of what has
    arrived of an event that is not complete."""

    def next_event(self) -> h11.Event | type[h11.NEED_DATA] | type[h11.PAUSED]:
        """Return the next event.

        Raises:
            RemoteProtocolError: the peer violates HTTP, or the head is too long.
        """
        event = super().next_event()
        if isinstance(event, h11.Request) and _size_of(event) > MAX_HEAD:
            raise h11.RemoteProtocolError(f"the head is over {MAX_HEAD} bytes")
        return event


def _size_of(head: h11.Request) -> int:
    """Return the bytes of a head with one blank where blanks are."""
    first = len(head.method) + len(head.target) + len(b"  HTTP/1.1\r\n")
    return first + sum(len(name) + len(value) + len(b": \r\n") for name, value in head.headers) + len(b"\r\n")


class PatientProtocol(H11Protocol):
    """uvicorn's HTTP/1.1 with limits for the head of a request. Of time: uvicorn closes only connections that idle
    after an answer; a head has `timeout_keep_alive` seconds from its first byte, and so has a new connection to begin
    one. Of size: `MAX_HEAD`.

    Requests that the parser refuses get a problem, as all others do."""

    head_timer: asyncio.TimerHandle | None = None

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self.conn = LimitedConnection(h11.SERVER, MAX_HEAD)

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Handle a new connection."""
        super().connection_made(transport)
        self._expect_head()

    def data_received(self, data: bytes) -> None:
        """Handle incoming data."""
        super().data_received(data)
        if self.conn.their_state is not h11.IDLE or self.transport.is_closing():
            self._forget_head()
        elif self.head_timer is None:
            self._expect_head()

    def connection_lost(self, exc: Exception | None) -> None:
        """Handle a closed connection."""
        self._forget_head()
        super().connection_lost(exc)

    def _expect_head(self) -> None:
        self.head_timer = self.loop.call_later(self.timeout_keep_alive, self._head_is_late)

    def _forget_head(self) -> None:
        if self.head_timer is not None:
            self.head_timer.cancel()
            self.head_timer = None

    def _head_is_late(self) -> None:
        self.head_timer = None
        if self.transport.is_closing() or self.conn.their_state is not h11.IDLE:
            return
        if self.conn.trailing_data[0]:  # no answer without a request: browsers connect ahead
            late = f"the head of the request did not come within {self.timeout_keep_alive:g} s"
            self._answer(TooSlow(late, hint="Send it again."))
        self.transport.close()

    def send_400_response(self, msg: str) -> None:
        """Answer a request that the parser refuses; `msg` is uvicorn's."""
        self._answer(MalformedRequest("the request is not valid HTTP/1.1", hint="Look at its first line and headers."))
        self.transport.close()

    def _answer(self, error: MareyError) -> None:
        answer = problem_response(error)
        headers = [*answer.raw_headers, (b"connection", b"close")]
        for event in (
            h11.Response(status_code=answer.status_code, headers=headers, reason=STATUS_PHRASES[answer.status_code]),
            h11.Data(data=bytes(answer.body)),
            h11.EndOfMessage(),
        ):
            self.transport.write(self.conn.send(event) or b"")


def connection_options(config: Settings) -> dict[str, Any]:
    """Return the arguments of uvicorn for HTTP connections."""
    return {"http": PatientProtocol, "timeout_keep_alive": config.idle_seconds}
