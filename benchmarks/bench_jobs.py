"""The queue's SQL on a real Postgres, with fsync: submitting 10,000 prompts, claims where much or little waits, in one
job or many, of one tenant or many, and the plan of a claim."""

from __future__ import annotations

import shutil
import statistics
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from uuid import uuid4

import sqlalchemy as sa

from benchmarks.harness import measure, table
from marey.db import create_engine, transaction, upgrade
from marey.db.ids import new_id
from marey.embedded import EmbeddedServer, start_postgres
from marey.jobs import NewItem, NewJob, claim, release, submit, tables
from marey.jobs.claim import LANES, LANES_TRIED, TAKE
from marey.tenants import create_tenant

PROMPTS = 10_000
CLAIMS = 400
BATCH = 32
DEPTHS = {
    "100 items in 1 job": (1, 100, 1),
    "100,000 items in 1 job": (1, 100_000, 1),
    "100,000 in 1,000 jobs": (1000, 100, 1),
    "100,000 in 100 jobs of 100 tenants": (100, 1000, 100),
    "100,000 in 1,000 jobs of 100 tenants": (1000, 100, 100),
}
"""Jobs, items of each, tenants."""
PLANNED = "100,000 in 1,000 jobs of 100 tenants"


def main() -> None:
    """Print both tables."""
    home = Path(tempfile.mkdtemp(prefix="marey-"))
    try:
        with start_postgres(home) as server:
            _submits(_database(server, "submits"))
            engines = {name: _filled(server, index, *depth) for index, (name, depth) in enumerate(DEPTHS.items())}
            _claims(engines)
            _plans(engines[PLANNED])
    finally:
        shutil.rmtree(home, ignore_errors=True)


def _submits(engine: sa.Engine) -> None:
    def by_submit() -> None:
        with transaction(engine) as conn:
            submit(conn, NewJob(_items(PROMPTS)))

    def by_inserts() -> None:
        """An ORM's bulk insert: the same rows by SQLAlchemy's insertmanyvalues."""
        job = new_id()
        with transaction(engine) as conn:
            conn.execute(sa.insert(tables.job).values(id=job, tenant_id="default", total=PROMPTS, ready=PROMPTS))
            conn.execute(sa.insert(tables.item), [_row(item, job) for item in _items(PROMPTS)])

    timings = measure(
        {f"submit() of {PROMPTS:,} prompts": by_submit, "bulk INSERT of as many rows": by_inserts},
        repeats=7,
        warm_up=1,
        seconds=25,
    )
    print(table("Submitting", timings, baseline="bulk INSERT of as many rows"))


def _claims(engines: dict[str, sa.Engine]) -> None:
    times: dict[str, list[float]] = {name: [] for name in engines}
    for _ in range(CLAIMS):  # in turns, so that a busy moment of the machine hits all alike
        for name, engine in engines.items():
            with transaction(engine) as conn:
                start = time.perf_counter()
                found = claim(conn, "hgm3", "bench", BATCH)
                times[name].append(time.perf_counter() - start)
            assert found is not None
            assert len(found.items) == BATCH
            with transaction(engine) as conn:
                release(conn, found.lease_token, "measured")
    print(f"A claim of {BATCH} ({CLAIMS} each, in turns)\n")
    print("| waiting | median | p95 | p95 against 100 |")
    print("|---|---|---|---|")
    least: float | None = None
    for name, taken in times.items():
        p95 = statistics.quantiles(taken, n=20)[-1]
        least = least or p95
        median = statistics.median(taken)
        print(f"| {name} | {median * 1e3:.2f} ms | {p95 * 1e3:.2f} ms | {p95 / least:.2f} |")


def _plans(engine: sa.Engine) -> None:
    """Query plans of the two statements of a claim; no item is taken."""
    with transaction(engine) as conn:
        choosing = {"queue": "hgm3", "tried": LANES_TRIED, "prefer": None}
        lane = conn.execute(LANES, choosing).first()
        assert lane is not None
        taking = {"job": lane.job_id, "queue": "hgm3", "batch_key": lane.batch_key, "solo": False, "limit": BATCH}
        lease = {"token": new_id(), "worker": "bench", "seconds": 10.0}
        for name, query, values in (("lane", LANES, choosing), (f"items, {BATCH}", TAKE, {**taking, **lease})):
            print(f"\nThe {name}: EXPLAIN (ANALYZE, BUFFERS)\n\n```")
            plan = conn.execute(sa.text(f"EXPLAIN (ANALYZE, BUFFERS, TIMING OFF) {query.text}"), values)
            print("\n".join(plan.scalars()))
            print("```")
        conn.rollback()


def _database(server: EmbeddedServer, name: str) -> sa.Engine:
    home = create_engine(server.url)
    with home.connect().execution_options(isolation_level="AUTOCOMMIT") as conn:
        conn.execute(sa.text(f"CREATE DATABASE {name}"))
    home.dispose()
    engine = create_engine(sa.make_url(server.url).set(database=name).render_as_string(hide_password=False))
    upgrade(engine)
    return engine


def _filled(server: EmbeddedServer, index: int, jobs: int, items: int, tenants: int) -> sa.Engine:
    """A database with so many jobs of so many items, of so many tenants in turns, their texts parsed."""
    engine = _database(server, f"claims_{index}")
    with transaction(engine) as conn:
        conn.execute(sa.insert(tables.text_features).values(key="known", blob=b""))
        for number in range(tenants):
            create_tenant(conn, f"tenant-{number}")
    for number in range(jobs):
        with transaction(engine) as conn:
            submit(conn, NewJob(_items(items, text_key="known"), tenant=f"tenant-{number % tenants}"))
    with engine.connect().execution_options(isolation_level="AUTOCOMMIT") as conn:
        conn.execute(sa.text("ANALYZE"))
    return engine


def _items(count: int, text_key: str | None = None) -> Iterator[NewItem]:
    settings = {"steps": 10, "guidance": 4.0, "formats": ["npz", "bvh"]}
    for index in range(count):
        yield NewItem(
            index=index,
            prompt=f"a person walks {index} steps forward, turns left and waves with the right hand",
            model="hgm3",
            bundle="starter@0123456789abcdef",
            batch_key="0123456789abcdef",
            text_key=text_key or f"{uuid4().hex}{uuid4().hex}",
            text_batch_key="fedcba9876543210",
            seed=index,
            settings=settings,
        )


def _row(item: NewItem, job: object) -> dict[str, object]:
    return {
        "id": new_id(),
        "job_id": job,
        "position": item.index,
        "index": item.index,
        "variant": 0,
        "prompt": item.prompt,
        "model": item.model,
        "bundle": item.bundle,
        "seed": item.seed,
        "settings": item.settings,
        "tags": [],
        "text_key": item.text_key,
        "generate_batch_key": item.batch_key,
        "stage": "text",
        "queue": "text",
        "batch_key": item.text_batch_key,
    }


if __name__ == "__main__":
    main()
