"""Room for large bodies: bytes given out never pass the limits, and come back whatever ends a request."""

from __future__ import annotations

import asyncio
from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from marey.core.errors import Overloaded
from marey.http import body_budget
from marey.http.body_budget import BodyBudget

TOTAL, TENANT = 100, 60
REQUESTS = st.lists(
    st.tuples(
        st.sampled_from(["ann", "bob", "cat"]),
        st.integers(1, TENANT),
        st.sampled_from(["ends", "fails", "is cancelled", "is cancelled soon"]),
        st.integers(0, 5),
    ),
    max_size=25,
)


@given(REQUESTS)
def test_bytes_stay_within_the_limits_and_come_back_whatever_ends_a_request(
    requests: list[tuple[str, int, str, int]],
) -> None:
    async def all_of_them() -> None:
        room = BodyBudget(TOTAL, TENANT, seconds=30)
        held: Counter[str] = Counter()

        async def request(tenant: str, size: int, end: str, turns: int) -> None:
            for _ in range(turns):
                await asyncio.sleep(0)
            async with room.take(tenant, size):
                held[tenant] += size
                assert held[tenant] <= TENANT
                assert held.total() <= TOTAL
                try:
                    for _ in range(turns):
                        await asyncio.sleep(0)
                    if end == "fails":
                        raise ZeroDivisionError
                finally:
                    held[tenant] -= size

        tasks = [(asyncio.ensure_future(request(*each)), each) for each in requests]
        await asyncio.sleep(0)
        for task, (_, _, end, turns) in tasks:
            if end.startswith("is cancelled"):
                for _ in range(0 if end.endswith("soon") else turns):
                    await asyncio.sleep(0)
                task.cancel()
        await asyncio.gather(*(task for task, _ in tasks), return_exceptions=True)
        assert room.used == 0
        async with room.take("ann", TENANT), room.take("bob", TOTAL - TENANT):
            pass

    asyncio.run(all_of_them())


def test_one_tenant_leaves_room_for_another_and_waits_for_its_own() -> None:
    async def scenario() -> None:
        room = BodyBudget(TOTAL, TENANT, seconds=0.05)
        async with room.take("ann", 50):
            with pytest.raises(Overloaded) as refused:
                async with room.take("ann", 20):
                    pass
            assert refused.value.seconds >= 1
            async with room.take("bob", 50):
                assert room.used == TOTAL
        patient = BodyBudget(TOTAL, TENANT, seconds=30)
        order: list[str] = []

        async def request(name: str, tenant: str, size: int) -> None:
            async with patient.take(tenant, size):
                order.append(name)

        async with patient.take("ann", TENANT):
            waiting = [asyncio.ensure_future(request(*each)) for each in (("second", "ann", 10), ("first", "bob", 40))]
            while "first" not in order:
                await asyncio.sleep(0)
            assert order == ["first"], "a request of the same tenant waits, that of another passes it"
        await asyncio.gather(*waiting)
        assert order == ["first", "second"]

    asyncio.run(scenario())


def test_too_many_who_wait_are_refused_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(body_budget, "WAITING", 1)

    async def scenario() -> None:
        room = BodyBudget(TOTAL, TOTAL, seconds=30)

        async def request() -> None:
            async with room.take("ann", TOTAL):
                pass

        async with room.take("ann", TOTAL):
            waiting = asyncio.ensure_future(request())
            await asyncio.sleep(0)
            with pytest.raises(Overloaded):
                await request()
        await waiting
        assert room.used == 0

    asyncio.run(scenario())


def test_those_who_wait_leave_room_for_another_tenant(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(body_budget, "WAITING", 8)

    async def scenario() -> None:
        room = BodyBudget(TOTAL, TENANT, seconds=30)

        async def request(tenant: str, size: int) -> str:
            try:
                async with room.take(tenant, size):
                    return "taken"
            except Overloaded:
                return "refused"

        async with room.take("ann", TENANT):
            waiting = [asyncio.ensure_future(request("ann", TENANT)) for _ in range(20)]
            await asyncio.sleep(0)
            assert await request("bob", 1) == "taken"
        found = Counter(await asyncio.gather(*waiting))
        assert found == {"taken": 4, "refused": 16}, "half of the places"
        assert room.used == 0

    asyncio.run(scenario())
