"""A small real model that streams, workers with it, and a client's view of their streams."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest
import redis
import sqlalchemy as sa

from marey.registry import streaming_models
from marey.runtime.live.port import SessionPool
from tests.support.live_loop import LiveWorker, Start, Studio
from tests.support.streaming_models import Around, Streaming, loaded


@pytest.fixture(scope="module", params=streaming_models())
def streaming(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Streaming]:
    with loaded(request.param, tmp_path_factory.mktemp(request.param)) as streaming:
        yield streaming


@pytest.fixture
def studio(engine: sa.Engine, client: redis.Redis, streaming: Streaming) -> Studio:
    return Studio(engine, client, streaming.model, streaming.bundle.reference)


@pytest.fixture
def start(engine: sa.Engine, client: redis.Redis, streaming: Streaming) -> Iterator[Start]:
    workers: list[LiveWorker] = []

    def begin(slots: int = 2, pool: Callable[[SessionPool], Any] = Around, **options: Any) -> LiveWorker:
        workers.append(LiveWorker(engine, client, lambda: pool(streaming.live.open_pool(slots)), **options))
        return workers[-1]

    yield begin
    for worker in workers:
        worker.stop()
