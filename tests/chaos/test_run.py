"""Every accepted item ends exactly once, whatever is killed: one short seed, and the long ones of `make chaos`."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from tests.chaos.driver import Cluster
from tests.chaos.places import S3, Disk, Place
from tests.chaos.run import Plan, Run, environment, free_ports
from tests.chaos.studios import Quota
from tests.chaos.webhooks import Flaky
from tests.servers.swift import Swift

pytestmark = pytest.mark.slow
ITEMS = int(os.environ.get("MAREY_CHAOS_ITEMS", "10000"))
SEEDS = [int(seed) for seed in os.environ.get("MAREY_CHAOS_SEEDS", "1,2,4").split(",")]
REPORTS = os.environ.get("MAREY_CHAOS_REPORTS")
"""Folder for a JSON report of each long run; `python -m tests.chaos.figures FOLDER` makes a table of them."""
DISK_BYTES = 160 * 2**20


SHORT_PLAN = Plan(
    items=60,
    seed=0,
    tenants={"north": (0.6, Quota(queued=24, running=12)), "south": (0.4, Quota())},
    toxic=("kill",),
    workers=2,
    item_seconds=0.2,
    job_sizes=(5, 12),
    calm=1.0,
    longest=2.0,
    faults=(9, 9),
    operator_pause=1.0,
    times={
        "MAREY_LEASE_SECONDS": "3",
        "MAREY_HEARTBEAT_SECONDS": "0.5",
        "MAREY_SWEEP_SECONDS": "0.5",
        "MAREY_MAX_ATTEMPTS": "2",
    },
    kinds=(
        *("worker's child killed", "scheduler killed", "API killed", "queue flushed"),
        *("Postgres stopped (fast)", "Postgres killed", "store away", "store full", "queue connections silent"),
    ),
)
"""A third of the product's times: a prompt that kills its worker takes three leases to end."""


def long_plan(seed: int) -> Plan:
    """At the product's own times, but for a batch that hangs: two minutes are long to wait for four times."""
    scale = ITEMS / 10_000
    return Plan(
        items=ITEMS,
        seed=seed,
        tenants={
            "north": (0.4, Quota(queued=max(400, round(2000 * scale)), running=64)),
            "south": (0.3, Quota(queued=max(400, round(1000 * scale)), files=max(600, round(2800 * scale)))),
            "east": (0.33, Quota()),  # more than is left: what south may not have for its bytes, another tenant submits
        },
        toxic=("kill", "hang") * 3,
        workers=4,
        item_seconds=0.1,
        job_sizes=(20, 300),
        calm=20.0,
        longest=10.0,
        faults=(24, 24),
        operator_pause=4.0,
        times={"MAREY_STALL_SECONDS": "40"},
    )


@pytest.fixture
def place(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Place]:
    """A bucket for even seeds, a small disk for odd ones."""
    with ExitStack() as stack:
        if request.param % 2 == 0:
            swift: Swift = request.getfixturevalue("swift")
            yield stack.enter_context(S3.proxied(swift))
            return
        try:
            yield stack.enter_context(Disk.mounted(tmp_path / "disk", DISK_BYTES))
        except PermissionError as error:
            pytest.skip(f"a small disk wants the right to mount: {error}")


def test_every_item_ends_once_whatever_is_killed(short_home: Path, swift: Swift) -> None:
    with S3.proxied(swift) as place:
        report = chaos(short_home, place, SHORT_PLAN, seconds=1800.0)
    assert {sample["until"] for sample in report["samples"] if sample["bar"] is not None} >= {
        *("API answers", "event delivered", "relay at work"),
    }


@pytest.mark.parametrize(("seed", "place"), [(seed, seed) for seed in SEEDS], indirect=["place"], ids=map(str, SEEDS))
def test_ten_thousand_items_of_three_tenants_end_once(short_home: Path, place: Place, seed: int) -> None:
    report = chaos(short_home, place, long_plan(seed), seconds=7200.0)
    assert report["odd_answers"] == []


def chaos(home: Path, place: Place, plan: Plan, seconds: float) -> dict[str, Any]:
    """A run, its audit and its report."""
    api, metrics = free_ports(2)
    with Flaky(plan.seed) as receiver, Cluster(home, environment(place, home, api, plan), proxied=True) as cluster:
        run = Run(cluster, place, plan, receiver, (api, metrics))
        run.go(seconds)
        wrong = run.wrong()
        report = run.report()
        if REPORTS is not None:
            folder = Path(REPORTS)
            folder.mkdir(parents=True, exist_ok=True)
            (folder / f"seed-{plan.seed}.json").write_text(json.dumps(report | {"wrong": wrong}, indent=1) + "\n")
            (folder / f"seed-{plan.seed}.log").write_text(cluster.logs(lines=20_000))
        assert wrong == []
        assert report["states"]["succeeded"] > 0
        return report
