"""Events of a job as JSON pages, or as a stream of server-sent events."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from uuid import UUID

from fastapi.sse import KEEPALIVE_COMMENT, format_sse_event

from services.api.jobs.schemas import EventView
from services.api.tailer import Tailer
from shared.errors import InvalidInput
from shared.jobs import ApiKey, EventRow

PING_SECONDS = 15.0
RETRY_MILLISECONDS = 1000
MAX_SEQ = 2**63 - 1


def last_event_id(header: str | None, after: int) -> int:
    """Where the client stands: `Last-Event-ID`, else the query's `after`.

    Raises:
        InvalidInput: the header is not a number.
    """
    if not header:
        return after
    if not header.isascii() or not header.isdecimal() or int(header[:20]) > MAX_SEQ:
        raise InvalidInput(f"{header[:40]!r} is not the id of an event", where="Last-Event-ID")
    return int(header)


async def stream_events(tailer: Tailer, key: ApiKey, job: UUID, seq: int) -> AsyncIterator[bytes]:
    """The events after `seq` as they happen, until the job has ended or is deleted, or the key is no longer valid."""
    yield format_sse_event(retry=RETRY_MILLISECONDS)
    async with tailer.follow(key, job, seq) as subscription:
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
    """One event on the wire; its data holds the job's state and counters as of then."""
    return format_sse_event(data_str=EventView.of(event).model_dump_json(), event=event.kind, id=str(event.seq))
