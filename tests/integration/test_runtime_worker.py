"""A real worker process: Celery parent and spawned child."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import psutil
import pytest
import sqlalchemy as sa
from pydantic import SecretStr

from marey.core.errors import InvalidInput, Unreachable
from marey.core.settings import Settings
from marey.db import transaction
from marey.jobs import list_workers, live_workers
from marey.jobs.tables import item, lease
from marey.runtime.child import import_handler
from marey.runtime.handler import Role
from marey.runtime.status import read_status
from marey.runtime.worker import wait_for_database, worker_main
from tests.chaos.driver import Cluster
from tests.support.toy import QUEUE, REFERENCE, ToyHandler
from tests.support.toy_jobs import BUNDLE, ended, job_row, submit_toys


@pytest.fixture
def cluster(short_home: Path) -> Iterator[Cluster]:
    with Cluster(short_home, {"MAREY_STORE": str(short_home / "assets")}) as made:
        yield made


def test_a_worker_loads_works_and_gives_back_on_sigterm(cluster: Cluster) -> None:
    """One life of a worker: its bundle is loaded before it is ready; SIGTERM costs no item an attempt."""
    cluster.start_scheduler()
    cluster.start_worker("one", bundle=BUNDLE)
    cluster.wait_ready("one")
    with transaction(cluster.engine) as conn:
        (row,) = list_workers(conn)
        assert (row.id, row.bundle, row.live) == (f"one/{QUEUE}", BUNDLE, True)
    assert psutil.Process(cluster.child("one")).ppid() == cluster.processes["one"].pid

    log = (cluster.home / "one.log").read_text().splitlines()
    assert {json.loads(line)["service"] for line in log} == {"worker-toy"}

    quick = submit_toys(cluster.engine, ["walk"] * 40)
    cluster.wait(lambda: ended(cluster.engine, quick), "the quick job ends")
    assert job_row(cluster.engine, quick).succeeded == 40

    slow = submit_toys(cluster.engine, ["walk"] * 8, steps=10_000, step_seconds=0.05)
    cluster.wait(lambda: job_row(cluster.engine, slow).leased == 8, "the slow job begins")
    assert cluster.terminate("one") == 0
    with transaction(cluster.engine) as conn:
        rows = conn.execute(sa.select(item.c.state, item.c.attempts, item.c.solo).where(item.c.job_id == slow)).all()
        assert {tuple(row) for row in rows} == {("ready", 0, False)}
        assert conn.execute(sa.select(lease)).all() == []
        assert live_workers(conn) == {}
    assert read_status(cluster.home, "one") is None


def test_a_worker_whose_bundle_is_not_here_ends_and_says_why(cluster: Cluster) -> None:
    cluster.start_worker("one", bundle="missing@0")
    assert cluster.processes["one"].wait(60.0) == 1
    cluster.processes.pop("one")
    assert "there is no bundle 'missing@0'" in (cluster.home / "one.log").read_text()


def test_handlers_come_by_name_from_wherever_they_are() -> None:
    assert isinstance(import_handler(REFERENCE), ToyHandler)
    for reference in ("tests.support.toy:Nobody", "tests.support.nowhere:ToyHandler", "nonsense"):
        with pytest.raises(InvalidInput, match="cannot be imported"):
            import_handler(reference)


def test_a_worker_without_database_says_what_to_set() -> None:
    with pytest.raises(InvalidInput, match="MAREY_DATABASE_URL"):
        worker_main(Role("toy", {QUEUE: REFERENCE}), Settings(database_url=None, queue_url=None))


def test_waiting_for_a_database_that_never_comes_ends(tmp_path: Path) -> None:
    chosen = Settings(database_url=SecretStr(f"postgresql+psycopg://marey@/marey?host={tmp_path}"))
    with pytest.raises(Unreachable, match="database"):
        wait_for_database(chosen, seconds=0.3)
