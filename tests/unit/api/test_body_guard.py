"""Bodies that are read before it is known who sends them: together they stay within a limit of memory."""

from __future__ import annotations

import asyncio
from typing import Any

from starlette.types import Message, Receive, Scope, Send

from marey.http.bodies import SMALL_BODY, BodyDeadline, BodyGuard
from marey.http.body_budget import BodyBudget

SIZE = SMALL_BODY + 1


def request(guard: BodyGuard, size: int, *, declared: bool = True) -> tuple[list[Message], Any]:
    """Responses of the guard, and the coroutine behind it."""
    sent: list[Message] = []
    headers = [(b"content-length", str(size).encode())] if declared else [(b"transfer-encoding", b"chunked")]
    scope: Scope = {"type": "http", "method": "POST", "path": "/v1/texts/parse", "headers": headers}
    coming: list[Message] = [{"type": "http.request", "body": b" " * size, "more_body": False}]

    async def receive() -> Message:
        return coming.pop() if coming else {"type": "http.disconnect"}

    async def send(message: Message) -> None:
        sent.append(message)

    return sent, guard(scope, receive, send)


def test_large_ones_wait_for_room_until_the_answer_and_small_ones_do_not() -> None:
    go = asyncio.Event()
    lengths: list[int] = []

    async def app(_: Scope, receive: Receive, send: Send) -> None:
        lengths.append(len((await receive())["body"]))
        await go.wait()
        await send({"type": "http.response.start", "status": 200, "headers": []})
        await send({"type": "http.response.body", "body": b""})

    async def scenario() -> None:
        guard = BodyGuard(app, BodyDeadline(60, 60))
        guard.room = BodyBudget(2**20, 2**20, seconds=0.05)
        first, running = request(guard, 2**20 - SIZE)
        second, also = request(guard, SIZE)
        small, third = request(guard, SMALL_BODY)
        tasks = [asyncio.ensure_future(each) for each in (running, also, third)]
        while len(lengths) < 3:
            await asyncio.sleep(0)
        assert guard.room.used == 2**20
        for declared in (True, False):
            refused, late = request(guard, SIZE, declared=declared)
            await late
            assert refused[0]["status"] == 503
            assert (b"retry-after", b"5") in refused[0]["headers"]
        go.set()
        await asyncio.gather(*tasks)
        assert {each[0]["status"] for each in (first, second, small)} == {200}
        assert sorted(lengths) == [SMALL_BODY, SIZE, 2**20 - SIZE]
        assert guard.room.used == 0

    asyncio.run(scenario())
