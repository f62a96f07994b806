"""Places of open connections: shares hold, and what is taken comes back."""

from __future__ import annotations

import asyncio
from collections import Counter
from contextlib import ExitStack
from datetime import UTC, datetime
from uuid import UUID, uuid4

import pytest
from hypothesis import given
from hypothesis import strategies as st

from marey.api.jobs.events import EventStream
from marey.core.errors import Busy
from marey.http.slots import SlotCounter, SlotLimits
from marey.tenants import ApiKey

SHARES = SlotLimits(total=12, tenant=7, key=4)
TENANTS = ("ann", "bob", "cat")
KEYS = [
    ApiKey(uuid4(), tenant, "key", "prefix", ("read",), datetime.now(UTC), None, None, None, None, {})
    for tenant in TENANTS
    for _ in range(3)
]
STEPS = st.lists(st.tuples(st.sampled_from(KEYS), st.booleans(), st.integers(0, 20)), max_size=80)


@given(STEPS)
def test_shares_hold_and_a_tenant_that_has_nothing_always_finds_a_place(steps: list[tuple]) -> None:
    places, opened = SlotCounter("streams", SHARES), list[tuple]()
    for key, opens, which in steps:
        if opens:
            stack = ExitStack()
            try:
                stack.enter_context(places.take(key))
            except Busy as error:
                refused = error
            else:
                opened.append((key, stack))
                refused = None
            tenants = Counter(each.tenant for each, _ in opened)
            if refused is not None:
                assert tenants[key.tenant], "who has nothing is never refused"
        elif opened:
            opened.pop(which % len(opened))[1].close()
        keys: Counter[UUID] = Counter(each.id for each, _ in opened)
        tenants = Counter(each.tenant for each, _ in opened)
        assert places.taken == len(opened) <= SHARES.total
        assert max(keys.values(), default=0) <= SHARES.key
        assert max(tenants.values(), default=0) <= SHARES.tenant
    for _, stack in opened:
        stack.close()
    assert places.taken == 0


def test_one_tenant_alone_leaves_half_of_the_places_and_three_leave_a_quarter() -> None:
    for count, free in ((1, 6), (2, 4), (3, 3)):
        places = SlotCounter("streams", SlotLimits(total=12, tenant=12, key=12))
        with ExitStack() as stack:
            for _ in range(12):
                for key in KEYS[: 3 * count : 3]:
                    try:
                        stack.enter_context(places.take(key))
                    except Busy:
                        continue
            assert 12 - places.taken == free


@pytest.mark.parametrize("end", ["is sent", "client is gone", "fails", "is cancelled"])
def test_a_stream_gives_its_place_back_however_it_ends(end: str) -> None:
    async def scenario() -> None:
        places, begun = SlotCounter("streams", SHARES), asyncio.Event()

        async def content():
            yield b"data: 1\n\n"
            assert places.taken == 1
            begun.set()
            if end == "is sent":
                return
            if end == "fails":
                raise ZeroDivisionError
            await asyncio.sleep(30)

        async def receive():
            await begun.wait()
            if end != "client is gone":
                await asyncio.sleep(30)
            return {"type": "http.disconnect"}

        async def send(message):
            pass

        stream = EventStream(places, KEYS[0], content())
        scope = {"type": "http", "asgi": {"spec_version": "2.3"}}
        answer = asyncio.ensure_future(stream(scope, receive, send))
        await begun.wait()
        if end == "is cancelled":
            answer.cancel()
        await asyncio.wait([answer], timeout=10)
        assert answer.done()
        assert answer.cancelled() or answer.exception() is not None or end in ("is sent", "client is gone")
        assert places.taken == 0

    asyncio.run(scenario())


def test_a_stream_without_a_place_is_a_problem_that_says_when_to_come_back() -> None:
    async def scenario() -> None:
        places, sent = SlotCounter("streams", SlotLimits(1, 1, 1)), []

        async def content():
            yield b"never"

        async def send(message):
            sent.append(message)

        with places.take(KEYS[0]):
            await EventStream(places, KEYS[0], content())({"type": "http"}, None, send)  # pyright: ignore
            assert places.taken == 1
        assert sent[0]["status"] == 429
        assert int(dict(sent[0]["headers"])[b"retry-after"]) >= 1

    asyncio.run(scenario())
