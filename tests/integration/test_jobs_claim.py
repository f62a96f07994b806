"""Claiming: lanes in order, each item to one worker."""

from __future__ import annotations

import multiprocessing
import threading
from collections import Counter
from multiprocessing.queues import SimpleQueue
from multiprocessing.synchronize import Barrier
from uuid import UUID, uuid4

import sqlalchemy as sa

from marey.db import create_engine, transaction
from marey.jobs import (
    JobState,
    Policy,
    WorkerHeartbeat,
    beat,
    cancel,
    claim,
    fail_items,
    get_job,
    heartbeat,
    list_items,
    list_workers,
    live_workers,
    load_texts,
    pause,
    release,
    resume,
    retire,
    set_priority,
    sweep,
    waiting_batches,
    waiting_items,
)
from marey.jobs.lease_types import Claim, ItemFailure
from marey.jobs.types import Edits
from marey.takes import NewEdit, submit_edit
from tests.servers.audit import audit
from tests.servers.jobs import (
    PROBLEM,
    claim_some,
    commit_all,
    let_expire,
    make_due,
    new_item,
    parse_texts,
    submit_items,
)

PROCESSES = multiprocessing.get_context("fork")  # eight imports would take longer than the test


def claim_everything(url: str, worker: str, gate: Barrier, found: SimpleQueue[list[bytes]]) -> None:
    """A worker process that claims until nothing is left."""
    engine = create_engine(url)
    claimed: list[UUID] = []
    gate.wait()
    while True:
        with transaction(engine) as conn:
            taken = claim(conn, "hgm3", worker, 7)
        if taken is None:
            break
        claimed += [item.id for item in taken.items]
    found.put([item.bytes for item in claimed])


def nothing_for(engine: sa.Engine, queue: str = "hgm3") -> bool:
    with transaction(engine) as conn:
        return claim(conn, queue, "w", 32) is None


def test_eight_processes_claim_a_thousand_items_and_no_item_twice(engine: sa.Engine, database_url: str) -> None:
    for _ in range(4):
        submit_items(engine, 250)
    parse_texts(engine)
    gate, found = PROCESSES.Barrier(8), PROCESSES.SimpleQueue()
    processes = [
        PROCESSES.Process(target=claim_everything, args=(database_url, f"worker {n}", gate, found)) for n in range(8)
    ]
    for process in processes:
        process.start()
    for process in processes:  # before their results: who failed puts none
        process.join(120)
    assert [process.exitcode for process in processes] == [0] * 8
    shares = [found.get() for _ in processes]
    claimed = Counter(item for share in shares for item in share)
    assert len(claimed) == 1000
    assert set(claimed.values()) == {1}
    assert sum(bool(share) for share in shares) > 1
    with transaction(engine) as conn:
        assert audit(conn) == []


def test_a_claim_takes_a_batch_in_input_order_of_one_lane(engine: sa.Engine) -> None:
    items = [new_item(n, bundle="a@1" if n % 2 else "b@1") for n in range(10)]
    job = submit_items(engine, items)
    parse_texts(engine)
    first = claim_some(engine, limit=3)
    second = claim_some(engine, limit=3, prefer_batch_key=first.batch_key)
    assert first.batch_key == second.batch_key
    assert [item.index % 2 for item in first.items + second.items] in ([0] * 5, [1] * 5)
    assert [item.position for item in first.items + second.items] == sorted(
        item.position for item in first.items + second.items
    )
    assert (first.job, first.tenant, first.queue, first.bundle) == (job, "default", "hgm3", first.items[0].bundle)


def test_the_text_stage_mixes_bundles_that_read_text_alike(engine: sa.Engine) -> None:
    submit_items(engine, [new_item(n, bundle=f"{n % 2}@1") for n in range(6)])
    assert len(claim_some(engine, "text", limit=64).items) == 6


def test_a_claimed_edit_names_its_operations_and_motions(engine: sa.Engine) -> None:
    submit_items(engine, 1)
    parse_texts(engine)
    claimed = claim_some(engine)
    commit_all(engine, claimed)
    with transaction(engine) as conn:
        (item,) = list_items(conn, "default", claimed.job).rows
        assert item.motion is not None
        submit_edit(conn, NewEdit(item.motion.id, [{"op": "mirror"}]))
    assert claim_some(engine, "edit").items[0].edits == Edits(({"op": "mirror"},), (item.motion.id,))


def test_priority_goes_before_age_and_age_before_nothing(engine: sa.Engine) -> None:
    old, new, urgent = submit_items(engine, 1), submit_items(engine, 1), submit_items(engine, 1, priority=1)
    with transaction(engine) as conn:
        set_priority(conn, "default", new, -1)
    assert [claim_some(engine, "text").job for _ in range(3)] == [urgent, old, new]


def test_the_tenant_with_less_running_goes_first(engine: sa.Engine) -> None:
    with transaction(engine) as conn:
        conn.execute(sa.text("INSERT INTO tenant (id) VALUES ('studio')"))
    large = submit_items(engine, 10, priority=100)
    small = submit_items(engine, 2, tenant="studio")
    assert [claim_some(engine, "text", limit=1).job for _ in range(5)] == [large, small, large, small, large]


def test_a_worker_keeps_its_bundle_until_another_lane_has_waited(engine: sa.Engine) -> None:
    first = submit_items(engine, [new_item(n, bundle="a@1") for n in range(4)])
    second = submit_items(engine, [new_item(n, bundle="b@1") for n in range(4)])
    parse_texts(engine)
    loaded = "batch of b@1"
    assert claim_some(engine, limit=1, prefer_batch_key=loaded).job == second
    assert claim_some(engine, limit=1, prefer_batch_key="batch of c@1").job == first
    with transaction(engine) as conn:
        conn.execute(
            sa.text("UPDATE lane SET waiting_since = now() - interval '31 seconds' WHERE job_id = :job"), {"job": first}
        )
    assert claim_some(engine, limit=1, prefer_batch_key=loaded).job == first
    assert claim_some(engine, limit=1, prefer_batch_key=loaded).job == second  # its wait began anew


def test_the_lane_a_worker_prefers_is_found_behind_many_others(engine: sa.Engine) -> None:
    for n in range(12):
        submit_items(engine, [new_item(0, "walk", bundle=f"{n}@1")])
    parse_texts(engine)
    found = claim_some(engine, prefer_batch_key="batch of 11@1")
    assert found.bundle == "11@1"


def test_two_workers_claim_from_one_job_without_waiting_for_each_other(engine: sa.Engine) -> None:
    busy, free = submit_items(engine, 2), submit_items(engine, 2)
    with transaction(engine) as first, transaction(engine) as second:
        one = claim(first, "text", "one", 1)
        two = claim(second, "text", "two", 1)
        assert one is not None
        assert two is not None
        assert (one.job, two.job) == (busy, free)


def test_a_claim_waits_for_the_only_job_there_is(engine: sa.Engine) -> None:
    submit_items(engine, 2)
    found: list[Claim | None] = []

    def take() -> None:
        with transaction(engine) as conn:
            found.append(claim(conn, "text", "two", 1))

    with transaction(engine) as conn:
        claim(conn, "text", "one", 1)
        thread = threading.Thread(target=take)
        thread.start()
        thread.join(0.2)
        assert thread.is_alive()
    thread.join()
    assert found[0] is not None


def test_waiting_batches_count_what_a_worker_could_claim(engine: sa.Engine) -> None:
    job = submit_items(engine, [new_item(n, bundle="a@1" if n < 5 else "b@1") for n in range(8)])
    sizes = {"text": 64, "hgm3": 4}
    with transaction(engine) as conn:
        assert waiting_batches(conn, sizes) == {"text": 1}
    parse_texts(engine)
    with transaction(engine) as conn:
        assert waiting_batches(conn, sizes) == {"hgm3": 3}
        pause(conn, "default", job)
        assert waiting_batches(conn, sizes) == {}


def test_waiting_items_are_counted_by_queue_as_long_as_their_job_runs(engine: sa.Engine) -> None:
    job = submit_items(engine, 1)
    with transaction(engine) as conn:
        assert waiting_items(conn) == {"text": 1}
        pause(conn, "default", job)
        assert waiting_items(conn) == {}


def test_a_paused_job_is_not_claimed_and_what_runs_may_finish(engine: sa.Engine) -> None:
    job = submit_items(engine, 4)
    parse_texts(engine)
    running = claim_some(engine, limit=2)
    with transaction(engine) as conn:
        assert pause(conn, "default", job).state is JobState.PAUSED
    assert nothing_for(engine)
    assert len(commit_all(engine, running)) == 2
    with transaction(engine) as conn:
        assert resume(conn, "default", job).state is JobState.RUNNING
    assert len(claim_some(engine).items) == 2


# --- leases ---


def test_a_heartbeat_renews_by_the_database_clock(engine: sa.Engine) -> None:
    submit_items(engine, 2)
    claimed = claim_some(engine, "text")
    let_expire(engine, claimed.lease_token)
    with transaction(engine) as conn:
        answer = heartbeat(conn, claimed.lease_token, [item.id for item in claimed.items], progressed=True)
    assert (answer.lost, answer.gone) == (False, frozenset())
    assert sweep(engine).leases_lost == 0
    with transaction(engine) as conn:
        left = conn.execute(
            sa.text("SELECT extract(epoch FROM expires_at - clock_timestamp()) FROM lease")
        ).scalar_one()
    assert 8 < left <= 10


def test_a_batch_without_progress_for_two_minutes_is_not_renewed(engine: sa.Engine) -> None:
    submit_items(engine, 1)
    claimed = claim_some(engine, "text")
    with transaction(engine) as conn:
        conn.execute(sa.text("UPDATE lease SET progress_at = now() - interval '121 seconds'"))
    let_expire(engine, claimed.lease_token)
    with transaction(engine) as conn:
        heartbeat(conn, claimed.lease_token, [claimed.items[0].id], progressed=False)
    assert sweep(engine).leases_lost == 1


def test_a_heartbeat_learns_what_was_cancelled_and_what_was_lost(engine: sa.Engine) -> None:
    job = submit_items(engine, 2)
    claimed = claim_some(engine, "text")
    items = [item.id for item in claimed.items]
    with transaction(engine) as conn:
        release(conn, claimed.lease_token, "one of them", items[:1])
        answer = heartbeat(conn, claimed.lease_token, items, progressed=True)
        assert (answer.lost, answer.gone) == (False, {items[0]})
        cancel(conn, "default", job)
        answer = heartbeat(conn, claimed.lease_token, items, progressed=True)
        assert (answer.lost, answer.gone) == (True, set(items))
        assert heartbeat(conn, uuid4(), items, progressed=True).lost


def test_a_lost_lease_marks_its_items_solo_and_costs_no_attempt(engine: sa.Engine) -> None:
    submit_items(engine, 3)
    parse_texts(engine)
    lost = claim_some(engine, worker="dies")
    let_expire(engine, lost.lease_token)
    report = sweep(engine)
    assert (report.leases_lost, report.items_returned, report.items_dead) == (1, 3, 0)
    for expected in lost.items:
        alone = claim_some(engine)
        assert alone.solo
        assert [(item.id, item.attempts) for item in alone.items] == [(expected.id, 0)]
        commit_all(engine, alone)
    with transaction(engine) as conn:
        assert audit(conn) == []


def test_a_new_stage_starts_with_fresh_attempts(engine: sa.Engine) -> None:
    submit_items(engine, 2)
    lost = claim_some(engine, "text", worker="dies")
    let_expire(engine, lost.lease_token)
    sweep(engine)
    assert claim_some(engine, "text", worker="another").solo
    with transaction(engine) as conn:
        (alone,) = conn.execute(sa.text("SELECT token FROM lease")).scalars()
        conn.execute(sa.text("UPDATE item SET attempts = 1 WHERE lease_token = :token"), {"token": alone})
    parse_texts(engine)
    let_expire(engine, alone)
    sweep(engine)
    parse_texts(engine)
    claimed = claim_some(engine)
    assert (claimed.solo, len(claimed.items)) == (False, 2)
    assert [item.attempts for item in claimed.items] == [0, 0]
    with transaction(engine) as conn:
        assert audit(conn) == []


def test_items_that_must_run_alone_go_one_at_a_time_with_fresh_ones_beside_them(engine: sa.Engine) -> None:
    submit_items(engine, 8)
    parse_texts(engine)
    lost = claim_some(engine, limit=2)
    let_expire(engine, lost.lease_token)
    sweep(engine)
    first = claim_some(engine, limit=3)
    assert [item.position for item in first.items] == [0]
    assert [item.position for item in claim_some(engine, limit=3).items] == [2, 3, 4]
    commit_all(engine, first)
    assert [item.position for item in claim_some(engine, limit=3).items] == [1]
    assert [item.position for item in claim_some(engine, limit=3).items] == [5, 6, 7]


def test_an_item_that_kills_its_worker_dies_and_its_neighbours_succeed(engine: sa.Engine) -> None:
    job = submit_items(engine, 8)
    parse_texts(engine)
    toxic: UUID | None = None
    losses = 0
    while not nothing_left(engine, job):
        claimed = claim_some(engine)
        toxic = toxic or claimed.items[3].id
        if toxic in {item.id for item in claimed.items}:
            losses += 1
            let_expire(engine, claimed.lease_token)
            sweep(engine)
        else:
            commit_all(engine, claimed)
    with transaction(engine) as conn:
        row = get_job(conn, "default", job)
        assert (row.succeeded, row.dead, row.state) == (7, 1, JobState.PARTIAL)
        dead = conn.execute(sa.text("SELECT id, attempts, problem FROM item WHERE state = 'dead'")).one()
        assert audit(conn) == []
    assert losses == 4  # once in a batch, then as often as there are attempts
    assert (dead.id, dead.attempts) == (toxic, 3)
    assert dead.problem["type"] == "worker-lost"


def test_items_that_kill_their_worker_end_a_job_early_too(engine: sa.Engine) -> None:
    job = submit_items(engine, 8, fail_early=0.0)
    parse_texts(engine)
    while not nothing_left(engine, job):
        claimed = claim_some(engine)
        let_expire(engine, claimed.lease_token)
        sweep(engine)
    with transaction(engine) as conn:
        row = get_job(conn, "default", job)
        assert (row.dead, row.cancelled, row.state) == (1, 7, JobState.FAILED)
        assert audit(conn) == []


def nothing_left(engine: sa.Engine, job: UUID) -> bool:
    with transaction(engine) as conn:
        row = get_job(conn, "default", job)
    return row.ready + row.leased == 0


def test_a_release_costs_nothing_however_often(engine: sa.Engine) -> None:
    submit_items(engine, 2)
    for _ in range(5):
        claimed = claim_some(engine, "text")
        assert len(claimed.items) == 2
        assert not claimed.solo
        with transaction(engine) as conn:
            assert len(release(conn, claimed.lease_token, "SIGTERM").items) == 2
    assert {item.attempts for item in claim_some(engine, "text").items} == {0}


def test_a_retryable_error_waits_counts_and_ends_dead(engine: sa.Engine) -> None:
    job = submit_items(engine, 1)
    parse_texts(engine)
    delays: list[float] = []
    for _ in range(3):
        claimed = claim_some(engine)
        with transaction(engine) as conn:
            fail_items(conn, claimed.lease_token, [ItemFailure(claimed.items[0].id, PROBLEM, retryable=True)])
            waits = "SELECT extract(epoch FROM run_after - clock_timestamp())::float FROM item"
            delays.append(conn.execute(sa.text(waits)).scalar_one() or 0.0)
        assert nothing_for(engine)
        assert sweep(engine).items_due == 0
        make_due(engine)
        assert sweep(engine).items_due == (len(delays) < 3)
    assert 4 < delays[0] <= 5 < 9 < delays[1] <= 10
    with transaction(engine) as conn:
        assert get_job(conn, "default", job).dead == 1
        assert audit(conn) == []


def test_two_sweepers_take_a_lease_back_once(engine: sa.Engine) -> None:
    for _ in range(5):
        submit_items(engine, 2)
        let_expire(engine, claim_some(engine, "text").lease_token)
    reports = []
    threads = [threading.Thread(target=lambda: reports.append(sweep(engine))) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sum(report.leases_lost for report in reports) == 5
    assert sum(report.items_returned for report in reports) == 10
    with transaction(engine) as conn:
        assert audit(conn) == []


# --- workers and texts ---


def test_a_worker_is_live_while_it_beats(engine: sa.Engine) -> None:
    rules = Policy(worker_live=5)
    with transaction(engine) as conn:
        for n in range(3):
            beat(conn, WorkerHeartbeat(f"w{n}", "hgm3" if n else "text", "host", n, "cpu"))
        conn.execute(sa.text("UPDATE worker SET seen_at = now() - interval '6 seconds' WHERE id = 'w2'"))
        assert live_workers(conn, rules=rules) == {"text": 1, "hgm3": 1}
        assert {(row.id, row.live) for row in list_workers(conn, rules=rules)} == {
            *(("w0", True), ("w1", True), ("w2", False)),
        }
        beat(conn, WorkerHeartbeat("w2", "hgm3", "host", 2, "cpu", bundle="b@1"))
        retire(conn, "w1")
        assert live_workers(conn, rules=rules) == {"text": 1, "hgm3": 1}


def test_text_features_come_in_one_query_those_that_are_known(engine: sa.Engine) -> None:
    submit_items(engine, 3)
    parse_texts(engine)
    keys = [new_item(n).text_key for n in range(3)]
    with transaction(engine) as conn:
        assert load_texts(conn, [*keys, keys[0], "unknown"]) == {
            key: f"walk {n}".encode() for n, key in enumerate(keys)
        }
