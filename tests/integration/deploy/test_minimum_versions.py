"""The oldest servers that Marey runs on, as Debian packages them: migrations, jobs, events, streams, quotas, files."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
import sqlalchemy as sa

from marey.cli import doctor_servers as backing
from marey.client.server_address import Server
from marey.client.transport import Transport
from marey.core.versions import POSTGRES, REDIS
from marey.db import create_engine, downgrade, transaction, upgrade
from marey.jobs import server_version
from marey.runtime.queue import check_queue, redis_client
from tests.servers.debian import INSTALLED, debian_postgres, debian_redis
from tests.support.live_api import LiveApi, running_api, settings_of
from tests.support.live_streams import Hand, add_streamer
from tests.support.proxied import submit_watch_and_fetch, watch_a_stream
from tests.support.streams_api import WALK

pytestmark = pytest.mark.skipif(not INSTALLED, reason=f"Debian's Postgres {POSTGRES} and Redis are not installed")


@pytest.fixture(scope="module")
def database() -> Iterator[str]:
    with debian_postgres() as url:
        yield url


@pytest.fixture(scope="module")
def queue() -> Iterator[str]:
    with debian_redis() as url:
        yield url


@pytest.fixture(scope="module")
def api(database: str, queue: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[LiveApi]:
    engine = create_engine(database)
    upgrade(engine)
    downgrade(engine, "base")
    upgrade(engine)
    engine.dispose()
    config = settings_of(tmp_path_factory.mktemp("oldest"), database, queue)
    config = config.model_copy(update={"rates": {"read": "6000/minute"}})
    add_streamer(config)
    with running_api(config, database) as api:
        yield api


def test_they_are_the_oldest_and_doctor_takes_them(api: LiveApi, queue: str) -> None:
    with transaction(api.engine) as conn:
        assert server_version(conn).startswith(f"{POSTGRES}.")
    assert check_queue(queue).startswith(f"{REDIS[0]}.{REDIS[1]}.")
    assert [backing.database(api.engine).state, backing.queue("queue", queue).state] == ["ok", "ok"]


def test_jobs_events_and_files(api: LiveApi, tmp_path: Path) -> None:
    submit_watch_and_fetch(api.url, api, tmp_path)


def test_live_streams(api: LiveApi, queue: str) -> None:
    with Transport(Server(api.url, api.key)) as client, redis_client(queue) as frames:
        stream = client.post_once("/v1/streams", WALK)["id"]
        watch_a_stream(api.url, api, Hand(api.engine, frames, stream))


def test_no_statement_needs_an_extension(api: LiveApi) -> None:
    with transaction(api.engine) as conn:
        extensions = conn.execute(sa.text("SELECT extname FROM pg_extension")).scalars().all()
    assert extensions == ["plpgsql"]
