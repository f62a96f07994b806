"""Connections to an object store that stay open and are never answered, and others that are slow and steady."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from marey.core.errors import Unreachable
from marey.jobs import asset_key
from marey.storage import NewObject, deadlines
from marey.storage.s3 import S3Store
from tests.servers.stalling_proxy import StallingProxy
from tests.servers.swift import Swift

DEADLINE = 2.0
LARGE = hashlib.shake_128(b"marey").digest(3 << 20)


@pytest.fixture
def brief(monkeypatch: pytest.MonkeyPatch) -> None:
    """Deadlines of a second."""
    monkeypatch.setattr(deadlines, "READ_SECONDS", DEADLINE)
    monkeypatch.setattr(deadlines, "CONNECT_SECONDS", DEADLINE)


@pytest.fixture
def proxy(swift: Swift) -> Iterator[StallingProxy]:
    """A way to the S3 server that can fall silent."""
    host, port = swift.endpoint.split(":")
    with StallingProxy((host, int(port))) as proxy:
        yield proxy


def store_behind(proxy: StallingProxy, swift: Swift) -> S3Store:
    """A store on a new bucket, reached through the proxy."""
    bucket = swift.new_store().options.bucket
    return S3Store(swift.options(bucket, endpoint=f"127.0.0.1:{proxy.port}"))


def key_of(content: bytes) -> str:
    return asset_key("default", hashlib.sha256(content).hexdigest())


def objects(count: int, prefix: str) -> list[NewObject]:
    contents = [f"{prefix} {n}".encode() for n in range(count)]
    return [NewObject(key_of(content), content) for content in contents]


USES: dict[str, Callable[[S3Store], object]] = {
    "put many": lambda store: list(store.put_all(objects(20, "late"))),
    "open": lambda store: list(store.open(key_of(b"walk"), 1, 2).chunks),
    "exists": lambda store: store.exists(key_of(b"walk")),
    "keys": lambda store: list(store.keys()),
    "check": lambda store: store.check(),
}


@pytest.mark.usefixtures("brief")
@pytest.mark.parametrize("use", USES.values(), ids=USES)
def test_whatever_falls_silent_is_asked_again_on_a_new_connection(
    proxy: StallingProxy, swift: Swift, use: Callable[[S3Store], object]
) -> None:
    store = store_behind(proxy, swift)
    store.put(key_of(b"walk"), b"walk")
    assert proxy.stall() == 1
    began = time.monotonic()
    use(store)
    assert time.monotonic() - began >= DEADLINE


@pytest.mark.usefixtures("brief")
def test_one_missed_deadline_drops_every_idle_connection(proxy: StallingProxy, swift: Swift) -> None:
    """Else each of the eight would cost a request a deadline."""
    store = store_behind(proxy, swift)
    list(store.put_all(objects(40, "early")))
    assert proxy.stall() > deadlines.RETRIES + 1
    assert len(list(store.put_all(objects(1, "late")))) == 1
    assert len(list(store.put_all(objects(40, "later")))) == 40
    until = time.monotonic() + 30.0
    while proxy.silent > 1:  # the proxy does not see the end of a connection that it holds a request of
        assert time.monotonic() < until, "requests went to silent connections"
        time.sleep(0.05)


@pytest.mark.usefixtures("brief")
def test_a_store_that_answers_nobody_is_unreachable_and_then_serves_again(proxy: StallingProxy, swift: Swift) -> None:
    store = store_behind(proxy, swift)
    proxy.stall(new=True)
    with pytest.raises(Unreachable, match="does not answer"):
        store.put(key_of(b"walk"), b"walk")
    proxy.resume()
    store.put(key_of(b"walk"), b"walk")
    assert store.get(key_of(b"walk")) == b"walk"


@pytest.mark.usefixtures("brief")
def test_an_object_that_falls_silent_in_its_midst_is_unreachable(proxy: StallingProxy, swift: Swift) -> None:
    store = store_behind(proxy, swift)
    store.put(key_of(LARGE * 3), LARGE * 3)
    chunks = store.open(key_of(LARGE * 3)).chunks
    next(chunks)
    proxy.stall()
    with pytest.raises(Unreachable):
        list(chunks)


@pytest.mark.usefixtures("brief")
def test_a_large_object_that_moves_slowly_but_steadily_arrives(swift: Swift, tmp_path: Path) -> None:
    """Three times the deadline each way."""
    host, port = swift.endpoint.split(":")
    path = tmp_path / "large.npz"
    path.write_bytes(LARGE)
    with StallingProxy((host, int(port)), pace=len(LARGE) / 3 / DEADLINE) as slow:
        store = store_behind(slow, swift)
        began = time.monotonic()
        store.put(key_of(LARGE), path)
        assert time.monotonic() - began > 2 * DEADLINE
        began = time.monotonic()
        assert store.get(key_of(LARGE)) == LARGE
        assert time.monotonic() - began > 2 * DEADLINE
