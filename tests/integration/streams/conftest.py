"""An API with Postgres and Valkey, a stream that waits, and hands for the worker's live loop."""

from __future__ import annotations

from collections.abc import Iterator

import httpx2
import pytest
import redis

from marey.core.settings import Settings
from marey.embedded import EmbeddedServer
from marey.runtime.queue import redis_client
from tests.support.live_api import LiveApi, running_api, settings_of
from tests.support.live_streams import PATIENCE, Hand, add_streamer
from tests.support.streams_api import begin, new_key


@pytest.fixture(scope="module")
def config(module_database_url: str, valkey: EmbeddedServer, tmp_path_factory: pytest.TempPathFactory) -> Settings:
    config = settings_of(tmp_path_factory.mktemp("streams"), module_database_url, valkey.url)
    add_streamer(config)
    return config


@pytest.fixture(scope="module")
def api(config: Settings, module_database_url: str) -> Iterator[LiveApi]:
    with running_api(config, module_database_url) as api:
        yield api


@pytest.fixture
def client(valkey: EmbeddedServer) -> Iterator[redis.Redis]:
    with redis_client(valkey.url) as client:
        yield client


@pytest.fixture
def secret(api: LiveApi) -> str:
    """A key of the test's own, for how many streams one may have."""
    return new_key(api, "read", "submit")


@pytest.fixture
def http(api: LiveApi, secret: str) -> Iterator[httpx2.Client]:
    with httpx2.Client(base_url=api.url, headers={"Authorization": f"Bearer {secret}"}, timeout=PATIENCE) as client:
        yield client


@pytest.fixture
def stream(http: httpx2.Client) -> Iterator[str]:
    """A stream that waits."""
    identifier = begin(http)["id"]
    yield identifier
    http.delete(f"/v1/streams/{identifier}")


@pytest.fixture
def hand(api: LiveApi, client: redis.Redis, stream: str) -> Hand:
    """The maker of the stream."""
    return Hand(api.engine, client, stream)
