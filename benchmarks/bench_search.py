"""`GET /v1/motions` at a million motions, as a client sees it: each filter right after a bulk load (no statistics), and
after ANALYZE; pages 1 and 50. `MAREY_BENCH_MOTIONS` makes it fewer."""

from __future__ import annotations

import itertools
import os
import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any
from urllib.parse import urlencode

import httpx2
import sqlalchemy as sa

from benchmarks.platform import Platform, platform

MOTIONS = int(os.environ.get("MAREY_BENCH_MOTIONS", "1000000"))
OF_A_JOB = 10_000
PAGE = 50
DEPTH = 50  # the deep page
WARM_UP, REPEATS = 2, int(os.environ.get("MAREY_BENCH_REPEATS", "20"))
BAR = 0.150

TEXTS = {
    "absent": "zebra",
    "rare": "pirouette",  # 1 in 10,000
    "common": "walking",  # 30 %
    "common, all old": "jumping",  # the oldest 30 %
    "two common, never together": "walking crawling",
    "phrase": '"walks slowly"',
    "none": None,
}
NAMES = {"absent": "zzz", "rare": "HERO", "common": "Take", "common, all old": "old"}
TAGS = {"common": "show=one", "rare": "shot=7"}
REVIEWS = {"new": "new", "kept (1 in 1,000)": "kept", "rejected (none)": "rejected"}

ITEMS = sa.text("""
    INSERT INTO item (id, job_id, position, index, variant, name, prompt, model, bundle, seed, settings, tags, text_key,
                      generate_batch_key, stage, queue, batch_key, state, reason, finished_at)
    SELECT CAST('01900000-0001-7000-8000-' || lpad(to_hex(n), 12, '0') AS uuid), CAST(:job AS uuid),
           CAST(n % CAST(:size AS bigint) AS int), CAST(n % CAST(:size AS bigint) AS int), 0,
           CASE WHEN n < 0.3 * CAST(:motions AS bigint) THEN 'old' WHEN n % 10 BETWEEN 3 AND 5 THEN 'take'
                WHEN n % 10000 = 8 THEN 'hero' ELSE 'sc' END || n,
           'a person ' || CASE WHEN n % 10 < 3 THEN 'walks ' WHEN n % 10 < 6 THEN 'crawls ' ELSE 'turns ' END || n
           || ' steps forward and waves with the right hand'
           || CASE WHEN n % 10000 = 7 THEN ' in a pirouette' ELSE '' END
           || CASE WHEN n < 0.3 * CAST(:motions AS bigint) THEN ', jumping' ELSE '' END,
           'toy', 'toy@0', n % 100000, '{}',
           CASE WHEN n % 10 BETWEEN 2 AND 4 THEN ARRAY['show=one'] WHEN n % 10000 = 9 THEN ARRAY['shot=7', 'show=two']
                ELSE ARRAY['show=two'] END,
           '', 'b', 'generate', 'toy', 'b', 'succeeded', 'committed', now()
    FROM generate_series(CAST(:first AS bigint), CAST(:first AS bigint) + CAST(:size AS bigint) - 1) AS n
""")
MADE = sa.text("""
    INSERT INTO motion (id, tenant_id, job_id, item_id, licence, frames, fps, elapsed, metadata, review, reviewed_at,
                        reviewed_by)
    SELECT CAST('01900000-0002-7000-8000-' || right(id::text, 12) AS uuid), 'default', job_id, id, 'CC-BY-4.0', 80, 20,
           0.1, '{"bundle": "toy@0", "note": "what a manifest holds of a motion, some hundred bytes of it"}',
           CASE WHEN position % 1000 = 1 THEN 'kept' END, CASE WHEN position % 1000 = 1 THEN now() END,
           CASE WHEN position % 1000 = 1 THEN 'ann' END
    FROM item WHERE job_id = :job
""")


@dataclass(frozen=True)
class Case:
    """One filter."""

    name: str
    params: tuple[tuple[str, str], ...]


def cases() -> Iterator[Case]:
    """Words and names, each alone and with a tag, a review, and both."""
    wanted = [
        *((f"text {name}", (("text", text),) if text else ()) for name, text in TEXTS.items()),
        *((f"name {name}", (("name", text),)) for name, text in NAMES.items()),
        ("text common, name common", (("text", "crawling"), ("name", "take"))),
    ]
    tags = [("", ()), *((f"tag {name}", (("tag", tag),)) for name, tag in TAGS.items())]
    reviews = [("", ()), *((f"review {name}", (("review", said),)) for name, said in REVIEWS.items())]
    for (first, a), (second, b), (third, c) in itertools.product(wanted, tags, reviews):
        yield Case("; ".join(filter(None, (first, second, third))), (*a, *b, *c))


def main() -> None:
    """Print p95 of each kind of filter, and the worst filters."""
    with platform(MAREY_RATES='{"read": "1000000/minute"}') as cluster:
        began = time.perf_counter()
        load(cluster.engine, MOTIONS)
        print(f"{MOTIONS:,} motions loaded in {time.perf_counter() - began:.0f} s; load {os.getloadavg()[0]:.1f}\n")
        cluster.serve()
        print(
            "| statistics | page | filters | median | p95 | slowest filter, p95 | over 150 ms |\n"
            "|---|---|---|---|---|---|---|"
        )
        rows = [*_measured(cluster, "none")]
        with cluster.engine.connect().execution_options(isolation_level="AUTOCOMMIT") as conn:
            conn.execute(sa.text("VACUUM ANALYZE"))
        rows += _measured(cluster, "ANALYZE")
        print("\nThe slowest filters:\n\n| statistics | page | filter | p95 |\n|---|---|---|---|")
        for p95, when, page, name in sorted(rows, reverse=True)[:12]:
            print(f"| {when} | {page} | {name} | {p95 * 1e3:.0f} ms |")


def load(engine: sa.Engine, motions: int) -> None:
    """Write jobs that have ended, with their motions; no statistics are gathered of them."""
    with engine.begin() as conn:
        for table in ("job", "item", "motion", "motion_search"):
            conn.execute(sa.text(f"ALTER TABLE {table} SET (autovacuum_enabled = false)"))
    for first in range(0, motions, OF_A_JOB):
        size = min(OF_A_JOB, motions - first)
        with engine.begin() as conn:
            conn.execute(sa.text("SET LOCAL session_replication_role = replica"))  # items begin as succeeded
            job = conn.execute(
                sa.text(
                    "INSERT INTO job (id, tenant_id, name, total, succeeded, finished_at) VALUES"
                    " (gen_random_uuid(), 'default', 'bulk', :size, :size, now()) RETURNING id"
                ),
                {"size": size},
            ).scalar_one()
            conn.execute(ITEMS, {"job": job, "first": first, "size": size, "motions": motions})
            conn.execute(MADE, {"job": job})


def _measured(cluster: Platform, statistics: str) -> list[tuple[float, str, int, str]]:
    rows: list[tuple[float, str, int, str]] = []
    with httpx2.Client(base_url=cluster.url, headers={"Authorization": f"Bearer {cluster.key}"}, timeout=60) as http:
        for page in (1, DEPTH):
            taken: list[float] = []
            slowest: list[tuple[float, str]] = []
            for case in cases():
                cursor = _cursor(http, case) if page > 1 else None
                times = sorted(_times(http, case, cursor))
                taken += times
                slowest.append((times[int(len(times) * 0.95) - 1], case.name))
            taken.sort()
            worst = max(slowest)
            over = sum(p95 > BAR for p95, _ in slowest)
            print(
                f"| {statistics} | {page} | {len(slowest)} | {taken[len(taken) // 2] * 1e3:.0f} ms "
                f"| {taken[int(len(taken) * 0.95)] * 1e3:.0f} ms | {worst[1]}, {worst[0] * 1e3:.0f} ms | {over} |",
                flush=True,
            )
            rows += [(p95, statistics, page, name) for p95, name in slowest]
    return rows


def _times(http: httpx2.Client, case: Case, cursor: str | None) -> Iterator[float]:
    for number in range(WARM_UP + REPEATS):
        began = time.perf_counter()
        _page(http, case.params, PAGE, cursor)
        if number >= WARM_UP:
            yield time.perf_counter() - began


def _cursor(http: httpx2.Client, case: Case) -> str | None:
    """The cursor of the deep page; of a filter that has fewer, of the place where it would be among all motions."""
    for params in (case.params, ()):
        cursor: str | None = None
        left = PAGE * (DEPTH - 1)
        while left:
            size = min(left, 1000)
            cursor = _page(http, params, size, cursor)["next"]
            left -= size
            if cursor is None:
                break
        else:
            return cursor
    return None


def _page(http: httpx2.Client, params: tuple[tuple[str, str], ...], limit: int, cursor: str | None) -> Any:
    query = [*params, ("limit", str(limit)), *([("cursor", cursor)] if cursor else [])]
    response = http.get(f"/v1/motions?{urlencode(query)}")
    response.raise_for_status()
    return response.json()


if __name__ == "__main__":
    main()
