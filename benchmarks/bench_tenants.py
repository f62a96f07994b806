"""Tenants on a real Postgres, with fsync: how long five prompts wait beside 50,000 of another, and what quotas cost."""

from __future__ import annotations

import shutil
import statistics
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from uuid import UUID

import sqlalchemy as sa

from benchmarks.harness import measure, table
from marey.db import create_engine, transaction, upgrade
from marey.embedded import start_postgres
from marey.jobs import NewItem, NewJob, cancel, claim, release, submit, tables
from marey.jobs.types import NO_TEXT
from marey.tenants import Quotas, create_tenant, usage

MANY, FEW = 50_000, 5
WORKERS, BATCH = 4, 32
BATCH_SECONDS = 0.25
"""Seconds per batch of a worker of this benchmark."""
ROUNDS = 15
FILES = 200_000


def main() -> None:
    """Print the tables."""
    home = Path(tempfile.mkdtemp(prefix="marey-"))
    try:
        with start_postgres(home) as server:
            engine = create_engine(server.url, pool_size=WORKERS + 2)
            upgrade(engine)
            with transaction(engine) as conn:
                create_tenant(conn, "many")
                create_tenant(conn, "few")
                create_tenant(conn, "bounded", Quotas(queued=10**6, running=10**6, bytes=2**50))
            _fairness(engine)
            _cost(engine)
            engine.dispose()
    finally:
        shutil.rmtree(home, ignore_errors=True)


def _fairness(engine: sa.Engine) -> None:
    alone = _waits(engine)
    _submit(engine, "many", MANY)
    beside = _waits(engine)
    print(f"{FEW} prompts, {WORKERS} workers, batches of {BATCH} in {BATCH_SECONDS:g} s, {ROUNDS} rounds\n")
    print("| beside them | median until the last is claimed | longest |")
    print("|---|---|---|")
    for what, waits in (("nothing", alone), (f"{MANY:,} of another tenant", beside)):
        print(f"| {what} | {statistics.median(waits) * 1e3:.0f} ms | {max(waits) * 1e3:.0f} ms |")


def _waits(engine: sa.Engine) -> list[float]:
    """Seconds from the commit of the few to the claim of their last, with all workers busy on the other jobs."""
    stopping = threading.Event()
    claimed: dict[UUID, float] = {}
    workers = [threading.Thread(target=_work, args=(engine, stopping, claimed)) for _ in range(WORKERS)]
    for worker in workers:
        worker.start()
    waits: list[float] = []
    for number in range(ROUNDS):
        time.sleep(BATCH_SECONDS * (1 + number / ROUNDS))  # at any moment of the workers' batches
        job = _submit(engine, "few", FEW)
        begun = time.perf_counter()
        while job not in claimed:
            time.sleep(0.001)
        waits.append(claimed[job] - begun)
    stopping.set()
    for worker in workers:
        worker.join()
    return waits


def _work(engine: sa.Engine, stopping: threading.Event, claimed: dict[UUID, float]) -> None:
    while not stopping.is_set():
        with transaction(engine) as conn:
            found = claim(conn, "hgm3", "bench", BATCH)
        if found is None:
            time.sleep(0.01)
            continue
        claimed[found.job] = time.perf_counter()
        stopping.wait(BATCH_SECONDS)
        with transaction(engine) as conn:
            release(conn, found.lease_token, "measured")
            if found.tenant == "few":
                cancel(conn, "few", found.job)


def _cost(engine: sa.Engine) -> None:
    _store(engine, "bounded", FILES)
    _submit(engine, "bounded", 1000)
    with transaction(engine) as conn:
        cancel(conn, "many", _oldest(conn, "many"))
    _submit(engine, "default", 1000)
    functions: dict[str, Callable[[], object]] = {
        "submit of 100, no quotas": lambda: _submit(engine, "many", 100),
        f"submit of 100, all quotas, {FILES:,} files stored": lambda: _submit(engine, "bounded", 100),
    }
    print()
    print(table("What quotas cost", measure(functions, repeats=15), baseline="submit of 100, no quotas"))
    with transaction(engine) as conn:
        conn.execute(sa.text("UPDATE job SET control = 'paused' WHERE tenant_id = 'bounded'"))
    free = measure({"claim of 32 and release, no quotas": lambda: _claim(engine)}, repeats=60)
    with transaction(engine) as conn:
        conn.execute(sa.text("UPDATE job SET control = CASE tenant_id WHEN 'bounded' THEN 'run' ELSE 'paused' END"))
    bound = measure({"claim of 32 and release, quota of running items": lambda: _claim(engine)}, repeats=60)
    print(table("", free + bound, baseline="claim of 32 and release, no quotas"))
    with transaction(engine) as conn:
        begun = time.perf_counter()
        usage(conn, "bounded")
        print(f"\nusage() over {FILES:,} files: {(time.perf_counter() - begun) * 1e3:.0f} ms")


def _claim(engine: sa.Engine) -> None:
    with transaction(engine) as conn:
        found = claim(conn, "hgm3", "bench", BATCH)
    assert found is not None
    with transaction(engine) as conn:
        release(conn, found.lease_token, "measured")


def _oldest(conn: sa.Connection, tenant: str) -> UUID:
    table_ = tables.job.c
    return conn.execute(
        sa.select(table_.id).where(table_.tenant_id == tenant).order_by(table_.id).limit(1)
    ).scalar_one()


def _store(engine: sa.Engine, tenant: str, files: int) -> None:
    rows = sa.text("""
        INSERT INTO asset (id, tenant_id, sha256, size, media_type, state, announced_at)
        SELECT gen_random_uuid(), :tenant, encode(sha256(n::text::bytea), 'hex'), 250000, 'x', 'stored', now()
        FROM generate_series(1, :files) AS n
    """)
    with transaction(engine) as conn:
        conn.execute(rows, {"tenant": tenant, "files": files})
    with engine.connect().execution_options(isolation_level="AUTOCOMMIT") as conn:
        conn.execute(sa.text("VACUUM ANALYZE"))


def _submit(engine: sa.Engine, tenant: str, count: int) -> UUID:
    with transaction(engine) as conn:
        return submit(conn, NewJob(_items(count), tenant=tenant, count=count)).id


def _items(count: int) -> Iterator[NewItem]:
    for index in range(count):
        yield NewItem(
            index=index,
            prompt=f"a person walks {index} steps forward",
            model="hgm3",
            bundle="starter@0123456789abcdef",
            batch_key="0123456789abcdef",
            text_key=NO_TEXT,
            text_batch_key=NO_TEXT,
            seed=index,
        )


if __name__ == "__main__":
    main()
