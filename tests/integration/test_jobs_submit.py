"""Submit: everything or nothing, once per idempotency key."""

from __future__ import annotations

import threading
import tracemalloc
from collections.abc import Iterator

import pytest
import sqlalchemy as sa

from marey.core.errors import InvalidInput
from marey.db import Listener, transaction
from marey.db.database import QUEUE_CHANNEL
from marey.jobs import (
    IdempotencyMismatch,
    JobState,
    NewItem,
    NewJob,
    SubmittedJob,
    events_after,
    get_job,
    list_items,
    list_jobs,
    submit,
    sweep,
    waiting_batches,
)
from marey.jobs.types import MAX_KEEP_DAYS
from tests.servers.audit import audit
from tests.servers.jobs import claim_some, new_item, parse_texts, submit_items


def test_a_submitted_job_is_queued_with_its_items_in_input_order(engine: sa.Engine) -> None:
    items = [
        new_item(0, "walk", seed=7, name="hero", tags=("a", "b"), seconds=2.5),
        new_item(0, "walk", seed=8, variant=1, name="hero"),
        new_item(1, "run 走る 🏃", settings={"steps": 3, "nested": {"x": [1, 2]}}),
    ]
    job = submit_items(engine, items, name="first", comment="a note", priority=5)
    with transaction(engine) as conn:
        row = get_job(conn, "default", job)
        listed = list_items(conn, "default", job).rows
        events = events_after(conn, "default", job)
        assert audit(conn) == []
    assert (row.state, row.total, row.ready, row.name, row.comment, row.priority) == (
        *(JobState.QUEUED, 3, 3, "first", "a note", 5),
    )
    assert [(item.position, item.index, item.variant, item.seed) for item in listed] == [
        *((0, 0, 0, 7), (1, 0, 1, 8), (2, 1, 0, 1)),
    ]
    assert (listed[0].name, listed[0].tags, listed[0].seconds) == ("hero", ("a", "b"), 2.5)
    assert (listed[2].prompt, listed[2].settings) == ("run 走る 🏃", {"steps": 3, "nested": {"x": [1, 2]}})
    assert [(event.seq, event.kind) for event in events] == [(1, "submitted")]


def test_timelines_and_constraints_reach_the_list_and_the_worker(engine: sa.Engine) -> None:
    rows = [{"start": 0.0, "end": 3.0, "prompt": "walk"}, {"start": 3.0, "end": 5.0, "prompt": "wave"}]
    wanted = [{"type": "root_path", "times": [0, 1]}]
    job = submit_items(engine, [new_item(0, "0-3 walk; 3-5 wave", timeline=rows, constraints=wanted), new_item(1)])
    with transaction(engine) as conn:
        listed = list_items(conn, "default", job).rows
    assert [(item.timeline, item.constraints) for item in listed] == [(rows, wanted), (None, None)]
    parse_texts(engine)
    claimed = claim_some(engine).items
    assert [(item.timeline, item.constraints) for item in claimed] == [(rows, wanted), (None, None)]


def test_items_whose_text_is_known_skip_the_text_stage(engine: sa.Engine) -> None:
    submit_items(engine, [new_item(0, "walk")])
    parse_texts(engine)
    submit_items(engine, [new_item(0, "walk", bundle="b@1"), new_item(1, "run", bundle="b@1")])
    with transaction(engine) as conn:
        assert waiting_batches(conn, {"text": 64, "hgm3": 32}) == {"text": 1, "hgm3": 2}
        assert audit(conn) == []


def test_a_job_without_items_is_refused_and_leaves_nothing(engine: sa.Engine) -> None:
    with pytest.raises(InvalidInput, match="nothing to submit"):
        submit_items(engine, 0, idempotency_key="k", body_sha256="0")
    with transaction(engine) as conn:
        assert list_jobs(conn, "default").rows == ()
        assert conn.execute(sa.text("SELECT count(*) FROM idempotency")).scalar_one() == 0


@pytest.mark.parametrize(
    ("change", "where"),
    [
        ({"prompt": "walk\0"}, r"items\.3\.prompt"),
        ({"prompt": "\ud800"}, r"items\.3\.prompt"),
        ({"prompt": "walk", "name": "a\0"}, r"items\.3\.name"),
        ({"prompt": "walk", "tags": ("\0",)}, r"items\.3\.tags"),
        ({"prompt": "walk", "seed": -1}, r"items\.3\.seed"),
        ({"prompt": "walk", "seed": 2**31}, r"items\.3\.seed"),
    ],
)
def test_a_bad_item_refuses_the_whole_job(engine: sa.Engine, change: dict[str, object], where: str) -> None:
    items = [new_item(0), new_item(1), new_item(2), new_item(3, **change)]  # pyright: ignore[reportArgumentType]
    with pytest.raises(InvalidInput, match=where):
        submit_items(engine, items)
    with transaction(engine) as conn:
        assert list_jobs(conn, "default").rows == ()


def test_the_most_days_that_a_job_may_be_kept_are_accepted(engine: sa.Engine) -> None:
    job = submit_items(engine, 1, keep_days=MAX_KEEP_DAYS)
    with transaction(engine) as conn:
        assert get_job(conn, "default", job).keep_days == MAX_KEEP_DAYS


@pytest.mark.parametrize(
    "change",
    [{"priority": 1001}, {"fail_early": 1.5}, {"name": "a\0"}, {"keep_days": 0}, {"keep_days": MAX_KEEP_DAYS + 1}],
)
def test_a_job_with_a_bad_value_is_refused(engine: sa.Engine, change: dict[str, object]) -> None:
    with pytest.raises(InvalidInput):
        submit_items(engine, 1, **change)


def test_the_same_submit_again_answers_the_first_job(engine: sa.Engine) -> None:
    def again(body: str) -> SubmittedJob:
        with transaction(engine) as conn:
            return submit(conn, NewJob(map(new_item, range(3)), idempotency_key="k", body_sha256=body))

    first = again("a")
    second = again("a")
    assert (first.replayed, second.replayed) == (False, True)
    assert (second.id, second.items) == (first.id, 3)
    with pytest.raises(IdempotencyMismatch, match="another body"):
        again("b")
    with transaction(engine) as conn:
        assert len(list_jobs(conn, "default").rows) == 1


def test_an_idempotency_key_is_free_again_after_a_day(engine: sa.Engine) -> None:
    first = submit_items(engine, 1, idempotency_key="k", body_sha256="a")
    with transaction(engine) as conn:
        conn.execute(sa.text("UPDATE idempotency SET created_at = now() - interval '24 hours 1 second'"))
    assert submit_items(engine, 1, idempotency_key="k", body_sha256="b") != first
    with transaction(engine) as conn:
        conn.execute(sa.text("UPDATE idempotency SET created_at = now() - interval '24 hours 1 second'"))
    sweep(engine)
    with transaction(engine) as conn:
        assert conn.execute(sa.text("SELECT count(*) FROM idempotency")).scalar_one() == 0


def test_eight_submits_at_once_with_one_key_make_one_job(engine: sa.Engine) -> None:
    answers: list[SubmittedJob] = []
    gate = threading.Barrier(8)

    def send() -> None:
        gate.wait()
        with transaction(engine) as conn:
            answers.append(submit(conn, NewJob(map(new_item, range(20)), idempotency_key="k", body_sha256="a")))

    threads = [threading.Thread(target=send) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(answers) == 8
    assert len({answer.id for answer in answers}) == 1
    assert sorted(answer.replayed for answer in answers) == [False] + [True] * 7


def test_ten_thousand_items_are_never_held_at_once(engine: sa.Engine) -> None:
    def items() -> Iterator[NewItem]:
        for index in range(10_000):
            yield new_item(index, f"{index} " + "walk " * 200)  # 10 MB of prompts

    tracemalloc.start()
    job = submit_items(engine, items())
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 8 << 20
    with transaction(engine) as conn:
        assert get_job(conn, "default", job).ready == 10_000
        assert audit(conn) == []


def test_submit_wakes_the_relay_when_it_commits(engine: sa.Engine, database_url: str) -> None:
    with Listener(database_url, (QUEUE_CHANNEL,)) as listener:
        with transaction(engine) as conn:
            submit(conn, NewJob([new_item(0)]))
            assert listener.wait(0.05) == []
        assert [note.payload for note in listener.wait(5)] == ["text"]
