"""`make soak`: a steady load on the real processes, with a trend test on their resources.

Jobs are submitted, made by a model that does nothing, followed as events, fetched, cancelled, paused, reported to a
webhook and deleted, for `SOAK_MINUTES` (15); memory, descriptors, threads, connections and the queue's keys are sampled
every five seconds, and a line is laid through all that came after the warm-up.
"""

from __future__ import annotations

import contextlib
import os
import random
import sys
import tempfile
import threading
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import psutil
import sqlalchemy as sa
from cryptography.fernet import Fernet

from benchmarks.platform import BUNDLE, Platform, platform
from benchmarks.trend import Trend, fit
from marey.client.downloads import download_all
from marey.client.fetching import plan
from marey.client.transport import Transport
from marey.core.errors import Conflict, MareyError
from marey.db import transaction
from marey.storage import open_store
from marey.takes import collect_garbage
from tests.servers.receiver import Receiver

MINUTES = float(os.environ.get("SOAK_MINUTES", "15"))
WARM_UP = min(180.0, MINUTES * 60 / 4)
SAMPLE_SECONDS = 5.0
HANDS = 3
"""Clients at once."""
PROMPTS = 64
KNOWN = 2000
"""Different prompts: texts of prompts are kept as long as the database, and a studio says the same things again."""
PAUSE = 0.5
"""Seconds between two jobs of a client."""
GC_SECONDS = 60.0
SCRAPE_SECONDS = 15.0
NEGLIGIBLE = {"MB": 2.0, "": 1.0}
"""Negligible growth per hour, by unit; "" = counts."""

Series = dict[tuple[str, str], list[tuple[float, float]]]


def main() -> None:
    """Print what was done, and the table of slopes."""
    extra = {"MAREY_WEBHOOK_KEY": Fernet.generate_key().decode(), "MAREY_WEBHOOK_ALLOW": '["127.0.0.0/8"]'}
    with platform(**extra) as cluster, Receiver() as receiver:
        cluster.serve()
        cluster.start_scheduler()
        for name in ("worker-1", "worker-2"):
            cluster.start_toys(name)
        for name in ("worker-1", "worker-2"):
            cluster.wait_ready(name)
        with cluster.client() as client:
            client.post("/v1/webhooks", {"url": receiver.url(), "name": "soak"})
        done, series = _run(cluster, receiver)
        _report(done, series)
        _report_tables(cluster)


def _run(cluster: Platform, receiver: Receiver) -> tuple[Counter[str], Series]:
    done: Counter[str] = Counter()
    stopping = threading.Event()
    duties: list[Callable[[], None]] = [lambda: _gc(cluster, stopping, done), lambda: _scrape(cluster, stopping, done)]
    duties += [lambda seed=seed: _hand(cluster, seed, stopping, done) for seed in range(HANDS)]
    threads = [threading.Thread(target=duty) for duty in duties]
    for thread in threads:
        thread.start()
    series: Series = defaultdict(list)
    started = time.monotonic()
    while (now := time.monotonic() - started) < MINUTES * 60:
        for name, value in _sample(cluster):
            series[name].append((now, value))
        done["webhooks received"] += len(receiver.received)
        receiver.received.clear()
        dead = [name for name, process in cluster.processes.items() if process.poll() is not None]
        assert not dead, f"ended: {', '.join(dead)}\n{cluster.logs()}"
        time.sleep(SAMPLE_SECONDS)
    stopping.set()
    for thread in threads:
        thread.join()
    return done, series


# --- the load ---


def _hand(cluster: Platform, seed: int, stopping: threading.Event, done: Counter[str]) -> None:
    """One client: a job after the other, each with one fate."""
    chance = random.Random(seed)
    with cluster.client() as client:
        while not stopping.is_set():
            try:
                _one_job(client, chance, done)
            except MareyError as error:
                done["errors"] += 1
                print(f"{type(error).__name__}: {error}", file=sys.stderr)
            stopping.wait(PAUSE)


def _one_job(client: Transport, chance: random.Random, done: Counter[str]) -> None:
    salt = chance.randrange(10**9)
    lines = [
        {"prompt": f"walk {salt} and turn {number} times", "model": BUNDLE, "tags": ["soak"]}
        for number in range(PROMPTS)
    ]
    lines[0]["prompt"] = f"refuse {salt}"
    job = client.submit(lines, name="soak")["id"]
    done["jobs"] += 1
    fate = chance.choice(("fetch", "fetch", "fetch", "cancel", "pause"))
    if fate == "cancel":
        client.post(f"/v1/jobs/{job}/cancel", reason="soak")
        done["jobs cancelled"] += 1
    elif fate == "pause":
        client.post(f"/v1/jobs/{job}/pause", reason="soak")
        with contextlib.suppress(Conflict):  # what ran has ended it meanwhile
            client.post(f"/v1/jobs/{job}/resume", reason="soak")
        done["jobs paused and resumed"] += 1
    done["events"] += sum(1 for _ in client.events(job))  # it ends with the job
    if fate == "fetch":
        _fetch(client, job, done)
    client.delete(f"/v1/jobs/{job}")


def _fetch(client: Transport, job: str, done: Counter[str]) -> None:
    with tempfile.TemporaryDirectory(prefix="marey-soak-") as folder:
        planned = plan(client.pages(f"/v1/jobs/{job}/items", limit=1000), Path(folder), None)
        files = [file for _, of_item in planned for file in of_item]
        download_all(client, files, overwrite=False, done=lambda _: None)
    done["files fetched"] += len(files)


def _gc(cluster: Platform, stopping: threading.Event, done: Counter[str]) -> None:
    """Garbage collection, as by `marey admin gc`."""
    store = open_store(cluster.settings())
    while not stopping.wait(GC_SECONDS):
        collect_garbage(cluster.engine, store)
        done["garbage collections"] += 1


def _scrape(cluster: Platform, stopping: threading.Event, done: Counter[str]) -> None:
    with cluster.client() as client:
        while not stopping.wait(SCRAPE_SECONDS):
            client.get("/v1/jobs", limit=50)
            client.get("/v1/models")
            done["listings"] += 1


# --- the samples ---


def _sample(cluster: Platform) -> Iterator[tuple[tuple[str, str], float]]:
    for name in ("api", "scheduler", "worker-1", "worker-2"):
        yield from _process(name, cluster.process(name))
        child = cluster.child(name) if name.startswith("worker") else 0
        if child:
            yield from _process(f"{name}, its child", psutil.Process(child))
    yield from _process("valkey", psutil.Process(cluster.valkey.process.pid))
    yield ("postgres, all of it", "memory, MB"), _postgres_megabytes(cluster.postgres.process.pid)
    with transaction(cluster.engine) as conn:
        counts = {
            "connections": "SELECT count(*) FROM pg_stat_activity WHERE backend_type = 'client backend'",
            "jobs": "SELECT count(*) FROM job",
            "leases": "SELECT count(*) FROM lease",
            "webhook deliveries waiting": "SELECT count(*) FROM webhook_delivery WHERE state = 'pending'",
        }
        for what, query in counts.items():
            yield ("database", what), float(conn.execute(sa.text(query)).scalar_one())
        size = conn.execute(sa.text("SELECT pg_database_size(current_database())")).scalar_one()
        yield ("database", "size on disk, MB"), size / 2**20
    with cluster.redis() as client:
        yield ("valkey", "keys"), float(client.dbsize())  # pyright: ignore[reportArgumentType]
        yield ("valkey", "own count of memory, MB"), client.info("memory")["used_memory"] / 2**20  # pyright: ignore[reportIndexIssue]


def _process(name: str, process: psutil.Process) -> Iterator[tuple[tuple[str, str], float]]:
    with contextlib.suppress(psutil.NoSuchProcess):
        with process.oneshot():
            memory, threads, descriptors = process.memory_info().rss, process.num_threads(), process.num_fds()
        yield (name, "memory, MB"), memory / 2**20
        yield (name, "threads"), threads
        yield (name, "file descriptors"), descriptors


def _postgres_megabytes(pid: int) -> float:
    """Memory of all Postgres processes; shared pages count once."""
    total = 0
    for process in (parent := psutil.Process(pid), *parent.children()):
        with contextlib.suppress(psutil.Error):
            total += process.memory_full_info().pss
    return total / 2**20


# --- the report ---


def _report(done: Counter[str], series: Series) -> None:
    print(f"{MINUTES:g} minutes, {HANDS} clients, jobs of {PROMPTS} prompts; warm-up {WARM_UP:g} s left out\n")
    print(", ".join(f"{count:,} {what}" for what, count in sorted(done.items())), end="\n\n")
    print("| of | what | mean | slope an hour, 95 % | verdict |")
    print("|---|---|---|---|---|")
    for (name, what), samples in series.items():
        kept = np.array([sample for sample in samples if sample[0] >= WARM_UP], np.float64)
        unit = "MB" if what.endswith("MB") else ""
        trend: Trend = fit(kept[:, 0], kept[:, 1], block=min(30.0, MINUTES * 2))
        verdict = trend.verdict(unit, negligible=NEGLIGIBLE[unit]).replace(" /h", "/h")
        print(f"| {name} | {what} | {trend.mean:.1f} | {trend.slope:+.2f} ± {trend.interval:.2f} | {verdict} |")


def _report_tables(cluster: Platform) -> None:
    """The largest tables at the end: what of the disk is a record by design, and what is left over."""
    query = sa.text("""
        SELECT relname AS name, n_live_tup AS rows, pg_total_relation_size(relid) / 1048576.0 AS megabytes
        FROM pg_stat_user_tables ORDER BY pg_total_relation_size(relid) DESC LIMIT 8
    """)
    print("\n| table at the end | rows | MB with its indexes |\n|---|---|---|")
    with transaction(cluster.engine) as conn:
        for row in conn.execute(query):
            print(f"| {row.name} | {row.rows:,} | {row.megabytes:.1f} |")


if __name__ == "__main__":
    main()
