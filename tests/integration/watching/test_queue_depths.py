"""Queue depths of the API, against rows."""

from __future__ import annotations

from dataclasses import replace

import sqlalchemy as sa

from marey.api.health.metrics import bounded
from marey.core.metrics import OTHER_TENANTS
from marey.db import transaction
from marey.jobs import QueueDepth, get_job, outbox_state, pause, queue_depths
from marey.tenants.tables import tenant
from tests.servers.jobs import claim_some, new_item, parse_texts, submit_items


def depths(engine: sa.Engine) -> dict[tuple[str, str], QueueDepth]:
    with transaction(engine) as conn:
        return {(row.queue, row.tenant): row for row in queue_depths(conn)}


def test_what_waits_and_runs_is_counted_by_queue_and_tenant(engine: sa.Engine) -> None:
    with transaction(engine) as conn:
        conn.execute(sa.insert(tenant), [{"id": "north"}])
    submit_items(engine, 3)
    parse_texts(engine)
    submit_items(engine, [new_item(5, bundle="other@0"), new_item(6)], tenant="north")
    claim_some(engine, limit=2)
    found = depths(engine)
    assert {key: (row.waiting, row.running) for key, row in found.items()} == {
        ("hgm3", "default"): (1, 2),
        ("text", "north"): (2, 0),
    }


def test_the_oldest_item_that_waits_gives_the_age_not_one_that_runs(engine: sa.Engine) -> None:
    old, new = submit_items(engine, 2), submit_items(engine, 1)
    parse_texts(engine)
    with transaction(engine) as conn:
        first = sa.text("UPDATE item SET created_at = now() - interval '1 hour' WHERE job_id = :job AND position = 0")
        conn.execute(first, {"job": old})
        lane = sa.text("UPDATE lane SET waiting_since = now() - interval '10 minutes' WHERE job_id = :job")
        conn.execute(lane, {"job": new})
    before = depths(engine)["hgm3", "default"]
    assert before.oldest >= 3600
    assert 600 <= before.unserved < 3600
    assert claim_some(engine, limit=1).job == old
    assert depths(engine)["hgm3", "default"].oldest < 3600


def test_a_paused_job_waits_for_its_operator_and_not_for_a_worker(engine: sa.Engine) -> None:
    job = submit_items(engine, 2)
    with transaction(engine) as conn:
        pause(conn, "default", job)
        assert get_job(conn, "default", job).ready == 2
    assert depths(engine) == {}


def test_nothing_to_tell_is_nothing_overdue(engine: sa.Engine) -> None:
    with transaction(engine) as conn:
        state = outbox_state(conn)
    assert (state.pending, state.overdue) == (0, 0.0)


def test_tenants_beyond_the_limit_are_summed_up() -> None:
    rows = [QueueDepth("hgm3", f"t{n}", waiting=n, running=1, oldest=10.0 * n, unserved=n) for n in range(1, 6)]
    rows.append(replace(rows[0], queue="text", waiting=7))
    shown = {(row.queue, row.tenant): row for row in bounded(rows, limit=2)}
    assert set(shown) == {("hgm3", "t1"), ("text", "t1"), ("hgm3", "t5"), ("hgm3", OTHER_TENANTS)}
    others = shown["hgm3", OTHER_TENANTS]
    assert (others.waiting, others.running, others.oldest, others.unserved) == (2 + 3 + 4, 3, 40.0, 4)
    assert bounded(rows, limit=10) == rows
