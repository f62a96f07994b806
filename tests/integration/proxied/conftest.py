"""An API and an S3 store that clients reach through something else, and an authority of the test's own."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
import redis

from marey.client.server_address import Server
from marey.client.transport import Transport
from marey.core.settings import Settings
from marey.embedded import EmbeddedServer
from marey.runtime.queue import redis_client
from tests.servers.ports import free_ports
from tests.servers.receiver import Authority
from tests.servers.swift import ACCESS_KEY, SECRET_KEY, Swift
from tests.support.live_api import LiveApi, running_api, settings_of
from tests.support.live_streams import Hand, add_streamer
from tests.support.streams_api import WALK


@pytest.fixture(scope="module")
def authority(tmp_path_factory: pytest.TempPathFactory) -> Authority:
    return Authority.make(tmp_path_factory.mktemp("authority"))


@pytest.fixture(scope="module")
def public_store() -> int:
    """Port at which clients reach the store, by https."""
    return free_ports(1)[0]


@pytest.fixture(scope="module")
def config(
    module_database_url: str,
    valkey: EmbeddedServer,
    swift: Swift,
    public_store: int,
    tmp_path_factory: pytest.TempPathFactory,
) -> Settings:
    config = settings_of(tmp_path_factory.mktemp("proxied"), module_database_url, valkey.url)
    add_streamer(config)
    own = {
        "store": f"s3://{swift.new_store().options.bucket}",
        "s3_endpoint": f"http://{swift.endpoint}",
        "s3_public_endpoint": f"https://localhost:{public_store}",
        "s3_access_key": ACCESS_KEY,
        "s3_secret_key": SECRET_KEY,
    }
    return Settings.model_validate({**config.model_dump(), **own})


@pytest.fixture(scope="module")
def api(config: Settings, module_database_url: str) -> Iterator[LiveApi]:
    with running_api(config, module_database_url) as api:
        yield api


@pytest.fixture
def frames(valkey: EmbeddedServer) -> Iterator[redis.Redis]:
    with redis_client(valkey.url) as client:
        yield client


@pytest.fixture
def hand(api: LiveApi, frames: redis.Redis) -> Iterator[Hand]:
    """A live stream of `api.key` that waits, and what shows it."""
    with Transport(Server(api.url, api.key)) as client:
        stream = client.post_once("/v1/streams", WALK)["id"]
        yield Hand(api.engine, frames, stream)
        client.delete(f"/v1/streams/{stream}")
