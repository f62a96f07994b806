"""Connections to Redis that stay open and are never answered: a deadline finds each, and work goes on."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import kombu
import kombu.utils.functional
import pytest
import redis

from marey.core.errors import Unreachable
from marey.embedded import EmbeddedServer
from marey.runtime import app as queue_app
from marey.runtime.app import RECONNECT_MAX, create_app
from marey.runtime.queue import redis_client
from marey.streams.redis import FrameStream
from tests.servers.stalling_proxy import StallingProxy

DEADLINE = 0.5
PATIENCE = 60.0


@pytest.fixture
def proxy(valkey: EmbeddedServer, queue_url: str) -> Iterator[StallingProxy]:
    """A way to an empty Valkey that can fall silent."""
    with StallingProxy(queue_url.removeprefix("redis+socket://")) as proxy:
        yield proxy


def url_of(proxy: StallingProxy) -> str:
    return f"redis://127.0.0.1:{proxy.port}/0"


def fill_pool(client: redis.Redis, count: int) -> None:
    """Leave `count` idle connections in the pool."""
    held = [client.connection_pool.get_connection() for _ in range(count)]
    for connection in held:
        client.connection_pool.release(connection)


def wait_until(condition: Callable[[], bool]) -> None:
    until = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < until, "not in time"
        time.sleep(0.02)


def test_one_missed_deadline_drops_every_connection_of_the_pool(proxy: StallingProxy) -> None:
    with redis_client(url_of(proxy), timeout=DEADLINE) as client:
        fill_pool(client, 8)
        assert proxy.stall() == 8
        began = time.monotonic()
        client.set("a", "1")
        assert time.monotonic() - began >= DEADLINE
        with ThreadPoolExecutor(8) as threads:
            began = time.monotonic()
            assert list(threads.map(client.get, ["a"] * 8)) == [b"1"] * 8
        # The proxy does not see the end of the one that it holds a request of.
        wait_until(lambda: proxy.silent <= 1)


def test_a_redis_that_answers_nobody_is_unreachable_and_then_serves_again(proxy: StallingProxy) -> None:
    with redis_client(url_of(proxy), timeout=DEADLINE) as client:
        client.ping()
        proxy.stall(new=True)
        with pytest.raises(redis.TimeoutError):
            client.ping()
        with pytest.raises(Unreachable):
            FrameStream(client, "s").bounds()
        proxy.resume()
        assert client.ping()


def test_a_consumer_finds_a_silent_connection_by_itself(
    proxy: StallingProxy, queue_url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(queue_app, "HEALTH_CHECK_INTERVAL", DEADLINE)
    monkeypatch.setattr(queue_app, "SOCKET_TIMEOUT", DEADLINE)
    consumer, publisher = create_app(url_of(proxy)), create_app(queue_url)
    heard: list[Any] = []
    with (
        consumer.connection_for_read() as connection,
        connection.Consumer([kombu.Queue("hints")], callbacks=[lambda body, _message: heard.append(body)]),
        publisher.connection_for_write() as direct,
    ):
        with pytest.raises(TimeoutError):
            connection.drain_events(timeout=0.2)  # BRPOP is under way
        assert proxy.stall() > 0
        hints, until = direct.SimpleQueue("hints"), time.monotonic() + PATIENCE
        while not heard and time.monotonic() < until:
            hints.put("hint")  # as the relay does: the first goes to the silent connection, and is lost
            with contextlib.suppress(TimeoutError):
                connection.drain_events(timeout=0.2)
    assert heard
    consumer.close()
    publisher.close()


def test_a_worker_tries_every_few_seconds_to_connect_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """Celery's consumer passes no pauses, and kombu's own grow to 30 s."""
    monkeypatch.setattr(kombu.utils.functional, "sleep", lambda _seconds: None)
    pauses: list[float] = []
    app = create_app("redis://127.0.0.1:1/0")
    with pytest.raises(Exception, match="refused"):
        app.connection_for_read().ensure_connection(lambda _error, pause: pauses.append(pause), 20)
    assert len(pauses) > 10
    assert max(pauses) == RECONNECT_MAX
    app.close()
