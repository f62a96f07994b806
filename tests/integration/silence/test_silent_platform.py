"""API, event stream, watcher and a worker's loop on one database whose connections fall silent."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
import sqlalchemy as sa

from marey.api import broadcaster as tailer_module
from marey.cli.watching import watch_job
from marey.client import Client
from marey.db import create_engine, outages
from marey.embedded import EmbeddedServer
from tests.servers.stalling_proxy import StallingProxy
from tests.support.live_api import LiveApi, running_api, settings_of
from tests.support.runtime import Loop
from tests.support.toy import ToyHandler
from tests.support.toy_jobs import ended, job_row, submit_toys

GENEROUS = 60.0
ITEMS = 32 * 12


@pytest.fixture
def silenced(proxied: str, database_url: str, valkey: EmbeddedServer, tmp_path: Path) -> Iterator[LiveApi]:
    """An API behind the proxy; its `engine` is a direct one."""
    with running_api(settings_of(tmp_path, proxied, valkey.url), database_url) as api:
        yield api


def test_everything_goes_on_after_all_connections_have_fallen_silent(
    silenced: LiveApi, proxied: str, proxy: StallingProxy
) -> None:
    engine = create_engine(proxied)
    loop = Loop(engine, silenced.store, ToyHandler(), interval=1.0)
    job = submit_toys(silenced.engine, ["walk"] * ITEMS, steps=5, step_seconds=0.1)
    followed = threading.Event()

    def follow() -> str:
        state = ""
        with silenced.client() as client:
            for event in client.events(str(job), patience=GENEROUS):
                state = event["data"].get("state", state)
                followed.set()
        return state

    def watch() -> str:
        with Client(silenced.url, silenced.key) as client:
            return watch_job(client, str(job), quiet=True).state

    with ThreadPoolExecutor(3) as pool:
        following, watching, working = pool.submit(follow), pool.submit(watch), pool.submit(loop.run)
        assert followed.wait(GENEROUS)
        _wait_for_a_commit(silenced.engine, job)
        began = time.monotonic()
        assert proxy.stall() > 3
        with silenced.client() as client:
            assert client.get(f"/v1/jobs/{job}")["state"] == "running"
        answered = time.monotonic() - began
        assert working.result(GENEROUS) >= ITEMS
        assert following.result(GENEROUS) == watching.result(GENEROUS) == "succeeded"
    assert answered < GENEROUS / 2
    assert ended(silenced.engine, job)
    assert outages(engine) >= 1
    loop.close()
    engine.dispose()


def _wait_for_a_commit(engine: sa.Engine, job: object) -> None:
    until = time.monotonic() + GENEROUS
    while not job_row(engine, job).succeeded:  # pyright: ignore[reportArgumentType]
        assert time.monotonic() < until
        time.sleep(0.05)


def test_an_event_stream_tells_what_no_notification_told(
    silenced: LiveApi, monkeypatch: pytest.MonkeyPatch, valkey: EmbeddedServer, tmp_path: Path, database_url: str
) -> None:
    monkeypatch.setattr(tailer_module, "EVENT_CHANNEL", "marey_nothing")
    monkeypatch.setattr(tailer_module, "REREAD_SECONDS", 0.5)
    home = tmp_path / "deaf"
    home.mkdir()
    with running_api(settings_of(home, database_url, valkey.url), database_url) as deaf, deaf.client() as client:
        job = submit_toys(silenced.engine, ["walk"] * 3)
        loop = Loop(silenced.engine, deaf.store, ToyHandler())
        events = client.events(str(job))
        assert next(events)["kind"] == "submitted"
        loop.run()
        assert [event["data"]["state"] for event in events][-1] == "succeeded"
        loop.close()
