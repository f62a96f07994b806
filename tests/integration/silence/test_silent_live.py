"""Live streams whose Redis falls silent: frames go on from the next one, on new connections."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any
from uuid import UUID

import pytest
import redis
import sqlalchemy as sa

from marey.core.errors import Unreachable
from marey.registry import streaming_models
from marey.runtime.live.main import REDIS_SECONDS
from marey.runtime.queue import SOCKET_SCHEME, redis_client
from marey.streams import StreamState
from marey.streams.frames import Frame
from marey.streams.redis import FrameStream
from tests.servers.stalling_proxy import StallingProxy
from tests.support.live_loop import LiveWorker, Studio
from tests.support.streaming_models import Streaming, loaded

STREAMS = 3
FRAMES = 20
"""A second of them."""


@pytest.fixture(scope="module", params=streaming_models())
def streaming(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Streaming]:
    with loaded(request.param, tmp_path_factory.mktemp(request.param)) as streaming:
        yield streaming


def goes_on(studio: Studio, streams: list[UUID]) -> float:
    """Wait until every stream has shown another second; gives how long the slowest took."""
    began, before = time.monotonic(), [studio.shown(stream) for stream in streams]
    wanted = [shown + FRAMES for shown in before]
    studio.until(
        lambda: all(studio.shown(stream) >= count for stream, count in zip(streams, wanted, strict=True)), "frames"
    )
    return time.monotonic() - began


def test_frames_go_on_after_redis_fell_silent(
    engine: sa.Engine, client: redis.Redis, queue_url: str, streaming: Streaming, monkeypatch: pytest.MonkeyPatch
) -> None:
    refused: list[float] = []
    write = FrameStream.write

    def noted(*arguments: Any) -> None:
        try:
            write(*arguments)
        except Unreachable:
            refused.append(worker.loop.ticked)
            raise

    monkeypatch.setattr(FrameStream, "write", noted)
    studio = Studio(engine, client, streaming.model, streaming.bundle.reference)
    with (
        StallingProxy(queue_url.removeprefix(SOCKET_SCHEME)) as proxy,
        redis_client(
            f"redis://127.0.0.1:{proxy.port}/0", timeout=REDIS_SECONDS, connect_timeout=REDIS_SECONDS
        ) as worker_client,
    ):
        worker = LiveWorker(engine, worker_client, lambda: streaming.live.open_pool(STREAMS))
        try:
            streams = [studio.begin("a person walks", seed=seed) for seed in range(STREAMS)]
            studio.until(lambda: all(studio.row(one).state is StreamState.LIVE for one in streams), "the streams")
            goes_on(studio, streams)
            assert proxy.stall() > 0
            print(f"open connections silent: frames of a second after {goes_on(studio, streams):.1f} s")
            proxy.stall(new=True)
            time.sleep(8 * REDIS_SECONDS)  # leases are lost, and taken again
            proxy.resume()
            print(f"everything silent: frames of a second after {goes_on(studio, streams):.1f} s")
            assert refused
            assert len(set(refused)) == len(refused)  # one deadline a tick, whatever the number of streams
            for stream in streams:
                numbers = [frame.number for frame in studio.frames(stream) if isinstance(frame, Frame)]
                assert numbers == list(range(len(numbers)))
        finally:
            worker.stop()
