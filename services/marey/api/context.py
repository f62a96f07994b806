"""Shared objects of the routes, one of each per process."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Annotated, TypeVar

import sqlalchemy as sa
from anyio import CapacityLimiter
from fastapi import Depends
from starlette.requests import HTTPConnection

from marey.api.broadcaster import EventBroadcaster
from marey.api.catalogue import Catalogue
from marey.api.making.maker import FileMaker
from marey.api.rates import RateLimiter
from marey.api.readiness import Readiness
from marey.api.stream_hub import Hub
from marey.api.text_client import TextService
from marey.core.errors import Unauthenticated
from marey.core.metrics import EVENT_STREAMS
from marey.core.settings import Settings
from marey.db import Deadline, transaction
from marey.http.body_budget import BodyBudget
from marey.http.slots import SlotCounter, SlotLimits
from marey.storage import AssetStore

LARGE_THREADS = 1
"""More than one would compete with each other instead of with other requests: there is one interpreter lock."""


@dataclass
class Context:
    """Shared objects, created at start-up, closed at shutdown."""

    config: Settings
    engine: sa.Engine
    store: AssetStore
    catalogue: Catalogue
    broadcaster: EventBroadcaster
    rates: RateLimiter
    texts: TextService
    readiness: Readiness
    """Cached checks of `/readyz`."""
    streams: Hub | None = None
    """None if no Redis is configured."""
    body_budget: BodyBudget = field(default_factory=BodyBudget)
    """Budget of bodies too large for memory."""
    large_threads: CapacityLimiter = field(default_factory=lambda: CapacityLimiter(LARGE_THREADS))
    """Threads for such bodies; other requests keep their threads."""
    event_streams: SlotCounter = field(init=False)
    """Open streams of server-sent events."""
    maker: FileMaker = field(init=False)
    """Files that are made on request."""

    def __post_init__(self) -> None:
        config = self.config
        shares = SlotLimits(config.event_streams, config.event_streams_per_tenant, config.event_streams_per_key)
        self.event_streams = SlotCounter("event streams", shares, EVENT_STREAMS)
        self.maker = FileMaker(config, self.engine, self.store)


async def context(asked: HTTPConnection) -> Context:
    """Return the context of this process, for a request or a socket. Async: needs no thread."""
    return asked.app.state.context


Shared = Annotated[Context, Depends(context)]


CONNECTIONS = 20
"""Database connections of one process."""
HELD = 10
"""Maximum connections held by routes; further requests wait without a thread. A route keeps its connection while it
waits for a thread, and its key is looked up on another: if routes could hold them all, sixty concurrent requests
would deadlock until the pool's timeout."""


DEADLINE = "marey_deadline"
Route = TypeVar("Route", bound=Callable[..., object])


def deadline(kind: Deadline) -> Callable[[Route], Route]:
    """Decorate a route whose `Connection` makes calls of this kind (`marey.db.deadlines`)."""

    def mark(route: Route) -> Route:
        setattr(route, DEADLINE, kind)
        return route

    return mark


def no_key() -> Unauthenticated:
    """Return the error of a request without a key."""
    return Unauthenticated("no API key was sent", hint="Send the header `Authorization: Bearer <key>`.")


def connection(shared: Shared, asked: HTTPConnection) -> Iterator[sa.Connection]:
    """Open a transaction for the duration of the route's function; it commits before the answer is sent.

    Raises:
        Unauthenticated: no key. Requests without a key take no connection; its validity is checked later.
    """
    if not asked.headers.get("authorization"):
        raise no_key()
    with transaction(shared.engine, getattr(asked.scope.get("endpoint"), DEADLINE, None)) as conn:
        yield conn


Connection = Annotated[sa.Connection, Depends(connection, scope="function", max_concurrency=HELD)]
