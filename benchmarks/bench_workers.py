"""Throughput by number of workers: items per second of a model that does nothing, with one to eight worker processes on
one Postgres and one Valkey. This is the platform's own limit, since such a model leaves all of the machine to it."""

from __future__ import annotations

import statistics

import psutil
import sqlalchemy as sa

from benchmarks.platform import Platform, platform, processor_seconds
from marey.db import transaction
from tests.support.toy_jobs import ended, job_row, submit_toys

WORKERS = (1, 2, 4, 8)
ITEMS = 32 * 40
JOBS = 8
"""Jobs at once: commits of one job wait for each other."""
REPEATS = 3


def main() -> None:
    """Print the table."""
    print(f"{JOBS} jobs, {ITEMS:,} items in all, batches of 32, {psutil.cpu_count()} cores\n")
    print("| workers | items/s | CPU of workers an item | CPU of Postgres an item | transactions an item |")
    print("|---|---|---|---|---|")
    with platform() as cluster:
        cluster.start_scheduler()
        started = 0
        for count in WORKERS:
            while started < count:
                cluster.start_toys(f"worker-{started}")
                cluster.wait_ready(f"worker-{started}")
                started += 1
            _work(cluster, started)  # every worker has its connections
            runs = [_work(cluster, started) for _ in range(REPEATS)]
            rate, own, postgres, commits = (statistics.median(run[place] for run in runs) for place in range(4))
            print(f"| {count} | {rate:.0f} | {own * 1e3:.2f} ms | {postgres * 1e3:.2f} ms | {commits:.2f} |")


def _work(cluster: Platform, workers: int) -> tuple[float, float, float, float]:
    """Items a second, and of one item: processor seconds of workers and of Postgres, transactions."""
    names = [f"worker-{number}" for number in range(workers)]
    before = _cpu(cluster, names), _postgres_cpu(cluster), _commits(cluster)
    jobs = [submit_toys(cluster.engine, ["walk"] * (ITEMS // JOBS)) for _ in range(JOBS)]
    cluster.wait(lambda: all(ended(cluster.engine, job) for job in jobs), "the jobs end", seconds=300)
    rows = [job_row(cluster.engine, job) for job in jobs]
    assert all(row.succeeded == ITEMS // JOBS for row in rows)
    begun = min(row.started for row in rows if row.started is not None)
    finished = max(row.finished for row in rows if row.finished is not None)
    after = _cpu(cluster, names), _postgres_cpu(cluster), _commits(cluster)
    own, postgres, commits = ((new - old) / ITEMS for old, new in zip(before, after, strict=True))
    return ITEMS / (finished - begun).total_seconds(), own, postgres, commits


def _cpu(cluster: Platform, names: list[str]) -> float:
    children = [psutil.Process(cluster.child(name)) for name in names]
    return sum(map(processor_seconds, children))


def _postgres_cpu(cluster: Platform) -> float:
    """Processor seconds of all Postgres processes, ended ones included."""
    parent = psutil.Process(cluster.postgres.process.pid)
    return sum(parent.cpu_times()[:4]) + sum(sum(child.cpu_times()[:2]) for child in parent.children())


def _commits(cluster: Platform) -> float:
    query = sa.text("SELECT xact_commit FROM pg_stat_database WHERE datname = current_database()")
    with transaction(cluster.engine) as conn:
        return conn.execute(query).scalar_one()


if __name__ == "__main__":
    main()
