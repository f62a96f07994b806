"""Overhead of the platform per item: claim, lease, files, store, commit, with a model that does nothing.

Both run through real processes on the same Postgres, Valkey and disk, in turns: a job of toy items (batches of 32, two
small files each) from its first claim to its last commit, and as many bare Celery tasks that do nothing.
"""

from __future__ import annotations

import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from benchmarks import noop
from marey.runtime.queue import redis_client
from tests.chaos.driver import REPOSITORY, Cluster
from tests.support.toy_jobs import ended, job_row, submit_toys

ITEMS = 32 * 30
REPEATS = 5


def main() -> None:
    """Print milliseconds an item, and the ratio."""
    home = Path(tempfile.mkdtemp(prefix="marey-"))
    try:
        with Cluster(home, {"MAREY_STORE": str(home / "assets"), "MAREY_LOG_LEVEL": "WARNING"}) as cluster:
            cluster.start_scheduler()
            cluster.start_worker("worker")
            cluster.wait_ready("worker")
            bare = _start_bare(cluster)
            try:
                _report(cluster)
            finally:
                bare.kill()
                bare.wait()
    finally:
        shutil.rmtree(home, ignore_errors=True)


def _report(cluster: Cluster) -> None:
    items: list[float] = []
    tasks: list[float] = []
    _items(cluster)
    _tasks(cluster)
    for _ in range(REPEATS):
        items.append(_items(cluster))
        tasks.append(_tasks(cluster))
    item, task = statistics.median(items), statistics.median(tasks)
    print(f"\n| what, of {ITEMS} | median | all | against a bare task |")
    print("|---|---|---|---|")
    for name, median, times in (("an item, batch 32", item, items), ("a bare Celery task", task, tasks)):
        spread = ", ".join(f"{seconds * 1e3:.2f}" for seconds in times)
        print(f"| {name} | {median * 1e3:.2f} ms | {spread} | {median / task:.2f} |")


def _items(cluster: Cluster) -> float:
    """Seconds an item, from the first claim to the last commit, by the database's clock."""
    job = submit_toys(cluster.engine, ["walk"] * ITEMS)
    cluster.wait(lambda: ended(cluster.engine, job), "the job ends")
    row = job_row(cluster.engine, job)
    assert row.succeeded == ITEMS
    assert row.started is not None
    assert row.finished is not None
    return (row.finished - row.started).total_seconds() / ITEMS


def _tasks(cluster: Cluster) -> float:
    """Seconds a task, from the first publish to the last that ran."""
    app = noop.make_app(cluster.valkey.url)
    with redis_client(cluster.valkey.url) as client:
        client.delete(noop.COUNTER)
        started = time.perf_counter()
        for number in range(ITEMS):
            app.send_task("noop", args=[str(number)], queue=noop.QUEUE)
        while int(client.get(noop.COUNTER) or 0) < ITEMS:  # pyright: ignore[reportArgumentType]
            time.sleep(0.005)
        return (time.perf_counter() - started) / ITEMS


def _start_bare(cluster: Cluster) -> subprocess.Popen[bytes]:
    with (cluster.home / "noop.log").open("ab") as log:
        return subprocess.Popen(
            [sys.executable, "-m", "benchmarks.noop"],
            cwd=REPOSITORY,
            env={**os.environ, "MAREY_QUEUE_URL": cluster.valkey.url},
            stdout=log,
            stderr=log,
        )


if __name__ == "__main__":
    main()
