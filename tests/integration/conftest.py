"""One API for the tests of a module; a module whose API is another brings its own."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import httpx2
import pytest
import redis

from marey.embedded import EmbeddedServer
from marey.runtime.queue import redis_client
from tests.support.live_api import LiveApi, running_api, settings_of

if TYPE_CHECKING:
    from tests.support.live_evaluations import Studio


@pytest.fixture
def client(queue_url: str) -> Iterator[redis.Redis]:
    """The test's own way to Valkey."""
    with redis_client(queue_url) as client:
        yield client


@pytest.fixture(scope="module")
def api_home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The home of the API; its bundles lie in `models`."""
    return tmp_path_factory.mktemp("api")


@pytest.fixture(scope="module")
def api(module_database_url: str, valkey: EmbeddedServer, api_home: Path) -> Iterator[LiveApi]:
    config = settings_of(api_home, module_database_url, valkey.url)
    with running_api(config, module_database_url) as api:
        yield api


@pytest.fixture(scope="module")
def place(module_database_url: str, valkey: EmbeddedServer, api_home: Path) -> Iterator[Studio]:
    """An API with bundles to evaluate, and the scheduler and the worker beside it."""
    from tests.support.live_evaluations import studio

    with studio(api_home, module_database_url, valkey.url) as place:
        yield place


@pytest.fixture
def http(api: LiveApi) -> Iterator[httpx2.Client]:
    with api.http() as client:
        yield client
