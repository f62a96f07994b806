"""ASGI middleware with limits on the size and the time of a request's body."""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncGenerator, AsyncIterator, Callable
from contextlib import AsyncExitStack, asynccontextmanager, suppress
from dataclasses import dataclass
from functools import partial
from typing import BinaryIO, Protocol, TypeVar

from anyio import CapacityLimiter, to_thread
from starlette.datastructures import Headers
from starlette.requests import ClientDisconnect, Request
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from marey.core.errors import InvalidInput, MalformedRequest, MareyError, TooLarge, TooSlow
from marey.core.spool import IN_MEMORY, Spool
from marey.http.body_budget import BodyBudget
from marey.http.problems import problem_response
from marey.items.item import MAX_BODY_BYTES

Result = TypeVar("Result")
MAX_OTHER_BODY = 2**20
"""Maximum bytes of any body except those with many prompts, and files."""
SMALL_BODY = 2**16
"""Bytes that any request may hold in memory."""
OTHER_BODIES = 64 * MAX_OTHER_BODY
"""Total bytes of larger bodies in memory. They are read before authentication."""
NO_ROOM = "Try again; if it stays so, look at the disk of the API's temporary files (TMPDIR)."
TWO_LENGTHS = "the request gives both Content-Length and Transfer-Encoding"
ONE_LENGTH = "Send one of them; a proxy between may have added the other."
LARGE_PATHS = ("/v1/jobs", "/v1/evaluations", "/v1/schedules", "/v1/rigs")
"""Paths of such bodies; their routes read them, after authentication."""
MIN_RATE = 4096
"""Minimum bytes a second, on average: half of a modem's rate."""
INCOMING = "marey.incoming"
"""Scope key of a request whose route reads the body itself."""
LINGER_SECONDS = 2.0
SILENT_SECONDS = 0.25
LINGER_BYTES = 2**20
"""Bytes of a refused body that are read and discarded: a client that still sends when the connection closes may lose
the answer with the reason."""


@dataclass(frozen=True)
class BodyDeadline:
    """Time limits of a body.

    Attributes:
        seconds: limit of the whole body.
        pause: limit for its first bytes, and in total while it is slower than `MIN_RATE`.
    """

    seconds: float
    pause: float

    def until(self, began: float, received: int) -> float:
        """Return the time at which the body counts as too slow, given the bytes received."""
        return began + min(self.seconds, self.pause + received / MIN_RATE)


class Incoming:
    """The body of one request while it is received: counts bytes, and raises when it is too slow."""

    def __init__(self, scope: Scope, receive: Receive, deadline: BodyDeadline) -> None:
        headers = Headers(scope=scope)
        self.whole = headers.get("content-length", "0") == "0" and "transfer-encoding" not in headers
        self._receive = receive
        self._deadline = deadline
        self._began = time.monotonic()
        self._received = 0

    async def __call__(self) -> Message:
        """Return the next message of the client.

        Raises:
            TooSlow: the body does not come fast enough.
        """
        if self.whole:
            return await self._receive()
        left = self._deadline.until(self._began, self._received) - time.monotonic()
        try:
            async with asyncio.timeout(left):
                return self._seen(await self._receive())
        except TimeoutError:
            raise TooSlow(
                f"the body did not come within {self._deadline.seconds:g} s, or at {MIN_RATE} bytes a second "
                f"({self._received} bytes did)",
                where="body",
                hint="Send it again, in parts if the line is slow.",
            ) from None

    @asynccontextmanager
    async def paused(self) -> AsyncGenerator[None]:
        """Exclude the time of the block: the client waits for the server."""
        before = time.monotonic()
        try:
            yield
        finally:
            self._began += time.monotonic() - before

    async def linger(self) -> None:
        """Discard the rest of the body: up to a limit of bytes and time, and until the client falls silent."""
        before = self._received
        with suppress(TimeoutError):
            async with asyncio.timeout(LINGER_SECONDS):
                while not self.whole and self._received - before < LINGER_BYTES:
                    async with asyncio.timeout(SILENT_SECONDS):
                        self._seen(await self._receive())

    def _seen(self, message: Message) -> Message:
        self._received += len(message.get("body", b""))
        self.whole = message["type"] != "http.request" or not message.get("more_body", False)
        return message


class BodyGuard:
    """Reads bodies up to their limits before a route sees them. Routes that take many prompts or a file read their own,
    within the same time limits.

    An answer before the end of the body closes the connection: the rest would otherwise be read for as long as the
    client sends.
    """

    def __init__(self, app: ASGIApp, deadline: BodyDeadline) -> None:
        self.app = app
        self.deadline = deadline
        self.room = BodyBudget(OTHER_BODIES, OTHER_BODIES)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on with its whole body, or refuse it."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        if _has_two_lengths(scope):
            answer = problem_response(
                MalformedRequest("gives both Content-Length and Transfer-Encoding", hint=ONE_LENGTH)
            )
            answer.headers["connection"] = "close"
            await answer(scope, receive, send)
            return
        incoming = Incoming(scope, receive, self.deadline)
        answer = _Answer(incoming, send)
        if _may_be_large(scope):
            scope[INCOMING] = incoming
            await self.app(scope, incoming, answer)
            return
        async with AsyncExitStack() as held:
            try:
                body = await self._read(Request(scope, incoming), incoming, held)
            except MareyError as error:
                await problem_response(error)(scope, incoming, answer)
                return
            await self.app(scope, _replay(body, receive), send)

    async def _read(self, request: Request, incoming: Incoming, held: AsyncExitStack) -> bytes:
        """Return the body; a large one waits for budget, which it keeps while `held` lasts. Raises as `kept_body`."""
        parts, size, roomy = list[bytes](), 0, False
        declared = _declared(request, MAX_OTHER_BODY)
        async for part in _parts(request, MAX_OTHER_BODY):
            size += len(part)
            if not roomy and max(size, declared) > SMALL_BODY:
                roomy = True
                async with incoming.paused():
                    await held.enter_async_context(self.room.take("", declared or MAX_OTHER_BODY))
            parts.append(part)
        return b"".join(parts)


def _replay(body: bytes, receive: Receive) -> Receive:
    """Return a `receive` that yields the whole body first."""
    sent = False

    async def replay() -> Message:
        nonlocal sent
        if sent:
            return await receive()
        sent = True
        return {"type": "http.request", "body": body, "more_body": False}

    return replay


class _Answer:
    """Sends an answer; closes the connection after one that does not wait for the body."""

    def __init__(self, incoming: Incoming, send: Send) -> None:
        self._incoming = incoming
        self._send = send
        self._early = False

    async def __call__(self, message: Message) -> None:
        if message["type"] == "http.response.start" and not self._incoming.whole:
            self._early = True
            message = {**message, "headers": [*message.get("headers", ()), (b"connection", b"close")]}
        if self._early and message["type"] == "http.response.body" and not message.get("more_body", False):
            await self._send({**message, "more_body": True})
            await self._incoming.linger()
            message = {"type": "http.response.body", "body": b""}
        await self._send(message)


class KeptBody:
    """A complete body, and the threads in which it may be read."""

    def __init__(self, file: BinaryIO, threads: CapacityLimiter | None) -> None:
        self.file = file
        self._threads = threads

    async def run(self, function: Callable[..., Result], *arguments: object) -> Result:
        """Run a function in a thread; a limited pool for a large body, so that other requests keep their threads."""
        return await to_thread.run_sync(partial(function, *arguments), limiter=self._threads)


class BodyLimits(Protocol):
    """Limits that the large bodies of one process share."""

    body_budget: BodyBudget
    large_threads: CapacityLimiter
    """Threads that read large bodies."""


@asynccontextmanager
async def kept_body(request: Request, limits: BodyLimits, tenant: str) -> AsyncGenerator[KeptBody]:
    """Receive a body that may be large, in a file above a size; the file is removed after the block.

    A large body waits for budget before it is read. One without a declared length takes the maximum.

    Raises:
        TooLarge, TooSlow, InvalidInput: as `_parts`.
        Overloaded: no budget is free now.
        Unreachable: the file cannot be written.
    """
    async with AsyncExitStack() as stack:
        incoming: Incoming = request.scope[INCOMING]
        spool = stack.enter_context(Spool("body", NO_ROOM))
        large = False

        async def take(size: int) -> None:
            nonlocal large
            large = True
            async with incoming.paused():
                await stack.enter_async_context(limits.body_budget.take(tenant, size))

        declared = _declared(request, MAX_BODY_BYTES)
        if declared > IN_MEMORY:
            await take(declared)
        async for part in _parts(request, MAX_BODY_BYTES):
            if not large and len(spool) + len(part) > IN_MEMORY:
                await take(MAX_BODY_BYTES)
            spool.write(part)
        yield KeptBody(spool.rewound(), limits.large_threads if large else None)


def _declared(request: Request, limit: int) -> int:
    """Return the length that a request declares; 0 = none.

    Raises:
        TooLarge: it is over `limit`.
        InvalidInput: not a number, or the body is compressed.
    """
    declared = request.headers.get("content-length", "0")
    if not declared.isdecimal():
        raise InvalidInput("is not a number", where="Content-Length")
    encoding = request.headers.get("content-encoding", "identity")
    if encoding.strip().lower() != "identity":
        message = f"{encoding[:40]!r} is not supported"
        raise InvalidInput(message, where="Content-Encoding", hint="Send the body uncompressed.")
    if int(declared) > limit:
        raise _too_large(limit)
    return int(declared)


async def _parts(request: Request, limit: int) -> AsyncIterator[bytes]:
    """Yield the body of a request as it arrives.

    Raises:
        TooLarge: over `limit` bytes; the rest is not read.
        TooSlow: it does not come fast enough.
        InvalidInput: the declared length is not a number, the body is compressed, or the client disconnected.
    """
    _declared(request, limit)
    size = 0
    try:
        async for part in request.stream():
            size += len(part)
            if size > limit:
                raise _too_large(limit)
            yield part
    except ClientDisconnect:  # the client is gone, but this is no bug
        raise InvalidInput("the client disconnected before the end of the body", where="body") from None


def _has_two_lengths(scope: Scope) -> bool:
    """Return True if a proxy that heeds the other header would see another request behind this one."""
    headers = Headers(scope=scope)
    return "content-length" in headers and "transfer-encoding" in headers


def _may_be_large(scope: Scope) -> bool:
    if scope["method"] == "PATCH":
        return scope["path"].startswith("/v1/schedules/")
    return scope["method"] == "POST" and scope["path"] in LARGE_PATHS


def _too_large(limit: int) -> TooLarge:
    return TooLarge(f"the body is over {limit / 2**20:g} MiB", where="body", hint="Send it in several requests.")
