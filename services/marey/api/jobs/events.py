"""Events of a job as JSON pages, or as a stream of server-sent events."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import ExitStack
from uuid import UUID

from fastapi.sse import KEEPALIVE_COMMENT, EventSourceResponse, format_sse_event
from starlette.types import Receive, Scope, Send

from marey.api.broadcaster import EventBroadcaster
from marey.api.jobs.schemas import EventView
from marey.core.errors import Busy, InvalidInput
from marey.http.problems import problem_response
from marey.http.slots import SlotCounter
from marey.jobs import EventRow
from marey.tenants import ApiKey

PING_SECONDS = 15.0
RETRY_MILLISECONDS = 1000
MAX_SEQ = 2**63 - 1


def last_event_id(header: str | None, after: int) -> int:
    """Return the client's position: `Last-Event-ID`, else the query's `after`.

    Raises:
        InvalidInput: the header is not a number.
    """
    if not header:
        return after
    if not header.isascii() or not header.isdecimal() or int(header[:20]) > MAX_SEQ:
        raise InvalidInput(f"{header[:40]!r} is not the id of an event", where="Last-Event-ID")
    return int(header)


class EventStream(EventSourceResponse):
    """A stream that occupies one slot of its key while it is sent, however it ends.

    The slot is taken when the answer begins, so that a request dropped earlier never occupies one; without a free
    slot, the answer is a problem.
    """

    def __init__(self, places: SlotCounter, key: ApiKey, content: AsyncIterator[bytes]) -> None:
        super().__init__(content, headers={"Cache-Control": "no-cache", "X-Accel-Buffering": "no"})
        self._slots, self._key = places, key

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send the response."""
        with ExitStack() as stack:
            try:
                stack.enter_context(self._slots.take(self._key))
            except Busy as error:
                await problem_response(error)(scope, receive, send)
            else:
                await super().__call__(scope, receive, send)


async def stream_events(broadcaster: EventBroadcaster, key: ApiKey, job: UUID, seq: int) -> AsyncIterator[bytes]:
    """Yield the events after `seq` as they happen, until the job has ended or is deleted, or the key is no longer
    valid."""
    yield format_sse_event(retry=RETRY_MILLISECONDS)
    async with broadcaster.follow(key, job, seq) as subscription:
        while True:
            try:
                async with asyncio.timeout(PING_SECONDS):
                    batch = await subscription.queue.get()
            except TimeoutError:
                yield KEEPALIVE_COMMENT
                continue
            if batch is None:
                return
            yield batch.wire
            if batch.last:
                return


def message(event: EventRow) -> bytes:
    """Encode one event as a server-sent event; its data holds the job's state and counters at that time."""
    return format_sse_event(data_str=EventView.of(event).model_dump_json(), event=event.kind, id=str(event.seq))
