"""Queue position and time left: from what was measured here, or no number."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
import sqlalchemy as sa

from marey.db import transaction
from marey.jobs import (
    NewMotion,
    WorkerHeartbeat,
    beat,
    begin_assets,
    cancel,
    commit_motions,
    estimate,
    pause,
    place_of,
)
from marey.tenants import set_quotas
from marey.tenants.quotas import EXPECTED_BYTES
from tests.servers.jobs import claim_some, motion_of, new_item, parse_texts, submit_items
from tests.support.command import Command
from tests.support.live_api import LiveApi

BUNDLE = "tiny@0"


@pytest.fixture
def measured(engine: sa.Engine) -> Iterator[sa.Engine]:
    """Ten motions of 0.5 s each were made, and two workers live."""
    submit_items(engine, 10)
    parse_texts(engine)
    claimed = claim_some(engine)
    motions: list[NewMotion] = [motion_of(item.id) for item in claimed.items]
    with transaction(engine) as conn:
        begin_assets(conn, claimed.lease_token, [motion.files["npz"] for motion in motions])
        commit_motions(conn, claimed.lease_token, motions)
        for name in ("a", "b"):
            beat(conn, WorkerHeartbeat(name, "hgm3", "here", 1, "cpu"))
    return engine


def test_time_is_motions_by_measured_speed_over_workers(measured: sa.Engine) -> None:
    with transaction(measured) as conn:
        found = estimate(conn, {("hgm3", BUNDLE): 100})
    assert (found.items, found.seconds, found.workers) == (100, 25.0, {"hgm3": 2})
    assert [(speed.bundle, speed.motions, speed.seconds) for speed in found.speeds] == [(BUNDLE, 10, 0.5)]


def test_without_a_measure_there_is_no_number(measured: sa.Engine) -> None:
    with transaction(measured) as conn:
        found = estimate(conn, {("hgm3", BUNDLE): 1, ("hgm3", "new@1"): 1})
    assert (found.seconds, found.unmeasured) == (None, ("new@1",))


def test_a_job_waits_for_higher_priorities_and_older_jobs_of_its_tenant_and_shares_with_others(
    measured: sa.Engine,
) -> None:
    items = [new_item(k, "walk 0") for k in range(4)]  # its features are known: they wait for the generator
    jobs = [submit_items(measured, items, priority=priority) for priority in (0, 0, 5)]
    with measured.begin() as conn:
        conn.execute(sa.text("INSERT INTO tenant (id) VALUES ('other')"))

    def standing(job: int) -> tuple[int, int, int, float | None]:
        with transaction(measured) as conn:
            place = place_of(conn, "default", jobs[job])
            return place.jobs_ahead, place.items_ahead, place.tenants, place.seconds

    assert [standing(k) for k in range(3)] == [(1, 4, 1, 2.0), (2, 8, 1, 3.0), (0, 0, 1, 1.0)]
    submit_items(measured, items, tenant="other", priority=900)
    assert standing(2) == (0, 0, 2, 2.0)  # its priority is worth nothing here: the two take turns
    with transaction(measured) as conn:
        pause(conn, "default", jobs[2])
    assert standing(0) == (0, 0, 2, 2.0)
    assert standing(2) == (0, 0, 2, None)
    with transaction(measured) as conn:
        cancel(conn, "default", jobs[1])
    assert standing(1) == (0, 0, 1, None)


def test_a_dry_run_tells_what_is_left_of_the_quotas_and_refuses_what_a_submit_would(
    api: LiveApi, marey: Command
) -> None:
    try:
        limit_to(api, queued=20, bytes=10 * EXPECTED_BYTES)
        ran = marey("submit", "a person waves", "--variants", 5, "--dry-run", "--json").ok()
        assert "It takes 5 of the quota of queued items: 0 of 20 are used, 20 left." in ran.err
        assert "It takes 2.5 MiB of the quota of stored bytes: 0 B of 5 MiB are used, 5 MiB left." in ran.err
        assert [quota["name"] for quota in ran.lines[0]["quotas"]] == ["queued", "bytes"]
        marey("submit", "a person waves", "--variants", 11, "--dry-run").refused(5, "quota of stored bytes")
        marey("submit", "a person waves", "--variants", 21, "--dry-run").refused(5, "quota of queued items")
    finally:
        limit_to(api, queued=None, bytes=None)
    assert marey("submit", "a person waves", "--dry-run", "--json").ok().lines[0]["quotas"] == []


def limit_to(api: LiveApi, **quotas: int | None) -> None:
    with transaction(api.engine) as conn:
        set_quotas(conn, "default", quotas)


def test_the_command_line_says_where_the_number_comes_from(api: LiveApi, marey: Command) -> None:
    dry = marey("submit", "a person walks", "--variants", 5, "--dry-run").ok().err
    assert "5 motions would be made, with hgm3-paperclip@" in dry
    assert "no estimate: none of the last motions made here was made with hgm3-paperclip@" in dry
    marey("submit", "a person walks", "--variants", 4).ok()
    api.work()
    with api.client() as client:
        job = client.submit([{"prompt": "a person walks", "variants": 100}] * 3)["id"]
    ran = marey("submit", "a person waves", "--variants", 100, "--dry-run", "--json").ok()
    assert "about 50 s, behind 300 that wait now" in ran.err
    assert "0.5 s a motion, measured on the last 4 of hgm3-paperclip@" in ran.err
    assert "no live hgm3 worker: one assumed" in ran.err
    assert (ran.lines[0]["estimate"]["seconds"], ran.lines[0]["waiting"]) == (50.0, 300)
    shown = marey("jobs", "show", job).ok().out
    assert "0 items of 0 jobs come first" in shown
    assert "about 2 min" in shown  # 300 motions of 0.5 s
    assert marey("jobs", "show", job, "--json").ok().lines[0]["queue"]["seconds"] == 150.0
