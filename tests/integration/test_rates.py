"""Rate limits, counted in a real Valkey."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from pathlib import Path

import httpx2
import pytest
import sqlalchemy as sa

from marey.api import rates
from marey.api.rates import RateLimiter
from marey.client.server_address import Server
from marey.client.transport import Transport
from marey.core.errors import Busy
from marey.core.settings import Settings
from marey.db import transaction
from marey.embedded import start_valkey
from marey.runtime.queue import redis_client
from marey.tenants import ApiKey, create_key
from tests.support.live_api import ApiThread, settings_of

LIMITS = {"read": "3/day", "submit": "2/day"}


@pytest.fixture
def new_key(engine: sa.Engine) -> Callable[..., ApiKey]:
    def new(**own: str) -> ApiKey:
        with transaction(engine) as conn:
            return create_key(conn, "ci", {"admin"}, rates=own).key

    return new


def counter(queue_url: str | None, limits: dict[str, str] = LIMITS) -> RateLimiter:
    return RateLimiter(Settings.model_validate({"queue_url": queue_url, "rates": limits}))


def taken(count: RateLimiter, key: ApiKey, kind: str = "read", tries: int = 10) -> int:
    """How many requests pass."""
    passed = 0
    for _ in range(tries):
        with contextlib.suppress(Busy):
            count.take(key, kind)
            passed += 1
    return passed


def test_processes_that_share_a_redis_share_the_count(queue_url: str, new_key: Callable[..., ApiKey]) -> None:
    one, other, key = counter(queue_url), counter(queue_url), new_key()
    one.take(key, "read")
    other.take(key, "read")
    assert (taken(one, key), taken(other, key)) == (1, 0)


def test_each_key_and_each_class_has_a_count_of_its_own(queue_url: str, new_key: Callable[..., ApiKey]) -> None:
    count = counter(queue_url)
    for key in (new_key(), new_key()):
        assert [taken(count, key, kind) for kind in ("read", "submit", "operate")] == [3, 2, 10]


def test_what_a_key_has_of_its_own_goes_before_what_the_server_says(
    queue_url: str, new_key: Callable[..., ApiKey]
) -> None:
    count = counter(queue_url)
    key = new_key(read="5/day", operate="1/hour")
    assert [taken(count, key, kind) for kind in ("read", "submit", "operate")] == [5, 2, 1]
    assert taken(counter(queue_url, {}), new_key()) == 10


def test_at_the_border_of_two_windows_no_more_pass_than_in_one(queue_url: str, new_key: Callable[..., ApiKey]) -> None:
    count, key, day = counter(queue_url), new_key(), 86_400_000
    assert taken(count, key) == 3
    with redis_client(queue_url) as client:
        (current,) = client.keys("*read*")
        client.pexpire(current, day - 1000)  # kept for two windows: its own ended a second ago
        assert taken(count, key) == 1  # of three that weigh nearly three, rounded down; a fixed window lets three pass
        (previous,) = client.keys("*read*/-1")
        client.pexpire(previous, day // 4)  # three quarters of the next one have passed
        assert taken(count, key) == 2


def test_while_redis_is_away_requests_are_served_and_counted_again_after(
    short_home: Path, new_key: Callable[..., ApiKey], monkeypatch: pytest.MonkeyPatch
) -> None:
    key = new_key()
    server = start_valkey(short_home)
    count = counter(server.url)
    assert taken(count, key) == 3
    server.kill()
    assert taken(count, key) == 10
    monkeypatch.setattr(count, "_again", 0.0)
    with start_valkey(short_home):
        monkeypatch.setattr(rates, "AWAY_SECONDS", 0.0)
        assert taken(count, new_key()) == 3


def test_nobody_waits_for_a_redis_that_did_not_answer_a_moment_ago(
    short_home: Path, new_key: Callable[..., ApiKey], monkeypatch: pytest.MonkeyPatch
) -> None:
    with start_valkey(short_home) as server:
        count = counter(server.url)
    key = new_key()
    assert taken(count, key, tries=1) == 1
    asked: list[object] = []
    monkeypatch.setattr(count._limiter, "hit", lambda *which: asked.append(which))
    assert taken(count, key) == 10
    assert asked == []


# --- over HTTP ---


@pytest.fixture
def limited(database_url: str, engine: sa.Engine, queue_url: str, tmp_path: Path) -> Iterator[tuple[str, str]]:
    """Address and key of an API with limits."""
    with transaction(engine) as conn:
        secret = create_key(conn, "ci", {"admin"}).secret
    config = settings_of(tmp_path, database_url, queue_url).model_copy(update={"rates": LIMITS})
    with ApiThread(config) as url:
        yield url, secret


def test_one_request_too_many_is_a_429_that_says_when_to_come_back(limited: tuple[str, str]) -> None:
    url, secret = limited
    with httpx2.Client(base_url=url, headers={"Authorization": f"Bearer {secret}"}, timeout=20) as http:
        assert [http.get("/v1/jobs").status_code for _ in range(4)] == [200, 200, 200, 429]
        refused = http.get("/v1/motions")
        assert refused.json()["type"] == "urn:marey:problem:busy"
        assert 1 <= int(refused.headers["Retry-After"]) <= 86_400
        body = {"items": [{"prompt": "a person walks"}]}
        assert [http.post("/v1/jobs", json=body).status_code for _ in range(3)] == [202, 202, 429]
        assert http.post("/v1/jobs", content=b"x", headers={"Authorization": "Bearer nonsense"}).status_code == 401
        assert http.get("/livez").status_code == 200


def test_the_command_line_ends_with_5_when_it_may_not_ask_again_soon(
    limited: tuple[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    url, secret = limited
    monkeypatch.setattr("time.sleep", lambda seconds: None)
    with Transport(Server(url, secret)) as client:
        for _ in range(3):
            client.get("/v1/jobs")
        with pytest.raises(Busy, match="rate read") as refused:
            client.get("/v1/jobs")
    assert refused.value.exit_code == 5
