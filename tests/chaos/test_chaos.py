"""Real processes, killed in the middle of their work, one fault a test; `test_run.py` has them all at random."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from uuid import UUID

import pytest
import sqlalchemy as sa

from marey.db import transaction
from marey.jobs.tables import item, lease
from marey.storage.port import AssetStore
from marey.takes import collect_garbage
from tests.chaos.driver import Cluster
from tests.chaos.places import S3, Folder
from tests.servers.swift import Swift
from tests.support.toy_jobs import audit, ended, job_row, states, submit_toys

pytestmark = pytest.mark.slow
Stage = Callable[..., Cluster]


@pytest.fixture
def stage(short_home: Path) -> Iterator[Stage]:
    """Starts a cluster with a scheduler and `workers` ready workers; all of it ends with the test."""
    clusters: list[Cluster] = []

    def start(environment: dict[str, str], workers: int = 2) -> Cluster:
        cluster = Cluster(short_home, environment)
        clusters.append(cluster)
        cluster.start_scheduler()
        for number in range(workers):
            cluster.start_worker(f"worker-{number}")
        for number in range(workers):
            cluster.wait_ready(f"worker-{number}")
        return cluster

    yield start
    for cluster in clusters:
        cluster.__exit__()


def prompts(count: int, *deeds: str) -> list[str]:
    """`count` harmless prompts with these in their midst."""
    walks = [f"walk {n}" for n in range(count - len(deeds))]
    middle = len(walks) // 2
    return [*walks[:middle], *deeds, *walks[middle:]]


def finish(cluster: Cluster, store: AssetStore, *jobs: UUID, seconds: float) -> None:
    """Wait for the end of all jobs, collect garbage once, and audit."""
    cluster.wait(lambda: all(ended(cluster.engine, job) for job in jobs), "the jobs end", seconds=seconds)
    wait_no_leases(cluster)
    collect_garbage(cluster.engine, store)
    assert audit(cluster.engine, store) == []


def wait_no_leases(cluster: Cluster) -> None:
    """Wait until no lease is held."""

    def none_held() -> bool:
        with transaction(cluster.engine) as conn:
            return conn.execute(sa.select(sa.func.count()).select_from(lease)).scalar_one() == 0

    cluster.wait(none_held, "no lease is held")


def working(cluster: Cluster, name: str) -> Callable[[], bool]:
    """Return True if the worker `name` holds a lease."""

    def holds() -> bool:
        with transaction(cluster.engine) as conn:
            return bool(conn.execute(sa.select(lease).where(lease.c.worker == f"{name}/toy")).first())

    return holds


def test_the_faults_of_the_contract_at_the_products_own_times(stage: Stage, tmp_path: Path, swift: Swift) -> None:
    """kill -9 of a child and of the scheduler, FLUSHALL, Postgres restart, 10 s without S3, in one 40-item job."""
    bucket = S3(swift)
    cluster = stage(bucket.environment)
    job = submit_toys(cluster.engine, prompts(40, "kill the worker"), steps=40, step_seconds=0.1)
    cluster.wait(working(cluster, "worker-1"), "worker-1 works")
    cluster.kill_child("worker-1")
    cluster.kill("scheduler")
    time.sleep(2.0)
    cluster.start_scheduler()
    cluster.flush_queue()
    with bucket.away():
        time.sleep(10.0)
    cluster.restart_postgres(seconds_away=3.0)
    finish(cluster, bucket.store, job, seconds=400.0)
    found = states(cluster.engine, job)
    assert found == {"dead": ["kill the worker"], "succeeded": prompts(39)}


def test_a_killed_workers_items_start_again_within_15_seconds(stage: Stage, tmp_path: Path) -> None:
    disk = Folder(tmp_path / "assets")
    cluster = stage(disk.environment, workers=2)
    job = submit_toys(cluster.engine, prompts(64), steps=300, step_seconds=0.1)
    cluster.wait(working(cluster, "worker-0"), "worker-0 works")
    cluster.wait(working(cluster, "worker-1"), "worker-1 works")
    with transaction(cluster.engine) as conn:
        held = set(
            conn.execute(
                sa.select(item.c.id)
                .join(lease, lease.c.token == item.c.lease_token)
                .where(lease.c.worker == "worker-0/toy")
            ).scalars()
        )
        token = conn.execute(sa.select(lease.c.token).where(lease.c.worker == "worker-0/toy")).scalar_one()
    cluster.kill_child("worker-0")

    def started_again() -> bool:
        with transaction(cluster.engine) as conn:
            again = conn.execute(
                sa.select(item.c.id).where(item.c.lease_token.is_not(None), item.c.lease_token != token)
            ).scalars()
            return bool(held & set(again))

    assert cluster.wait(started_again, "an item starts again") < 15.0
    assert not ended(cluster.engine, job)


def test_sigterm_gives_items_back_at_no_cost(stage: Stage, tmp_path: Path) -> None:
    disk = Folder(tmp_path / "assets")
    cluster = stage(disk.environment)
    job = submit_toys(cluster.engine, prompts(40), steps=100, step_seconds=0.1)
    cluster.wait(working(cluster, "worker-0"), "worker-0 works")
    assert cluster.terminate("worker-0", timeout=30.0) == 0
    with transaction(cluster.engine) as conn:
        held = conn.execute(sa.select(lease.c.worker)).scalars().all()
        rows = conn.execute(sa.select(item.c.attempts, item.c.solo)).all()
    assert "worker-0/toy" not in held
    assert {tuple(row) for row in rows} == {(0, False)}
    finish(cluster, disk.store, job, seconds=120.0)
    assert job_row(cluster.engine, job).succeeded == 40


def test_two_schedulers_and_a_restarted_queue_are_harmless(stage: Stage, tmp_path: Path) -> None:
    """The queue is away while both workers end their drain, so that their acknowledgements fail."""
    disk = Folder(tmp_path / "assets")
    cluster = stage(disk.environment)
    cluster.start_scheduler("scheduler-2")
    job = submit_toys(cluster.engine, prompts(200), steps=2, step_seconds=0.2)
    cluster.wait(working(cluster, "worker-0"), "worker-0 works")
    cluster.restart_valkey(seconds_away=3.0)
    late = submit_toys(cluster.engine, prompts(100), steps=2, step_seconds=0.1)
    finish(cluster, disk.store, job, late, seconds=120.0)
    assert job_row(cluster.engine, job).succeeded == 200
    assert job_row(cluster.engine, late).succeeded == 100


def test_eight_workers_claiming_a_thousand_items_claim_none_twice(stage: Stage, tmp_path: Path) -> None:
    disk = Folder(tmp_path / "assets")
    cluster = stage(disk.environment, workers=8)
    watched: list[int] = []
    stop = threading.Event()

    def watch() -> None:
        while not stop.wait(0.2):
            with transaction(cluster.engine) as conn:
                watched.append(conn.execute(sa.select(sa.func.count(sa.distinct(lease.c.worker)))).scalar_one())

    thread = threading.Thread(target=watch)
    thread.start()
    try:
        job = submit_toys(cluster.engine, prompts(1000), steps=1, step_seconds=0.2)
        finish(cluster, disk.store, job, seconds=120.0)
    finally:
        stop.set()
        thread.join()
    assert job_row(cluster.engine, job).succeeded == 1000
    assert max(watched) > 4  # they did work side by side
