"""Operator verbs and listings."""

from __future__ import annotations

from collections.abc import Callable
from uuid import UUID, uuid4

import pytest
import sqlalchemy as sa

from marey.core.errors import Conflict, InvalidInput, NotFound
from marey.db import Listener, transaction
from marey.db.database import QUEUE_CHANNEL
from marey.db.pages import Page
from marey.jobs import (
    ItemFailure,
    ItemState,
    JobControl,
    JobState,
    cancel,
    claim,
    events_after,
    fail_items,
    get_job,
    get_motion,
    list_items,
    list_jobs,
    pause,
    resume,
    retry,
    set_comment,
    set_fail_early,
    set_priority,
)
from marey.takes import delete, list_motions
from tests.servers.audit import audit
from tests.servers.jobs import PROBLEM, claim_some, commit_all, new_item, parse_texts, submit_items


def finish(engine: sa.Engine, *, failed: int = 0, succeeded: int = 0, left: int = 0) -> UUID:
    """A job with so many items failed, succeeded and ready."""
    job = submit_items(engine, failed + succeeded + left)
    parse_texts(engine)
    if failed + succeeded:
        claimed = claim_some(engine, limit=failed + succeeded)
        bad = [ItemFailure(item.id, PROBLEM, retryable=False) for item in claimed.items[:failed]]
        with transaction(engine) as conn:
            fail_items(conn, claimed.lease_token, bad)
        if succeeded:
            commit_all(engine, claimed, [item.id for item in claimed.items[failed:]])
    return job


def test_cancel_ends_what_is_open_and_keeps_what_is_done(engine: sa.Engine) -> None:
    job = finish(engine, succeeded=2, failed=1, left=3)
    claim_some(engine, limit=1)
    with transaction(engine) as conn:
        row = cancel(conn, "default", job, "wrong prompts")
        assert (row.state, row.succeeded, row.failed, row.cancelled) == (JobState.CANCELLED, 2, 1, 3)
        assert claim(conn, "hgm3", "w", 1) is None
        assert cancel(conn, "default", job) == row
        assert [event.reason for event in events_after(conn, "default", job) if event.kind == "cancelled"] == [
            "wrong prompts"
        ]
        assert audit(conn) == []


def test_retry_brings_back_failed_dead_and_cancelled_items(engine: sa.Engine) -> None:
    job = finish(engine, succeeded=1, failed=2, left=2)
    with transaction(engine) as conn:
        cancel(conn, "default", job)
        row = retry(conn, "default", job, failed_only=True)
        assert (row.ready, row.cancelled, row.control, row.state) == (2, 2, JobControl.RUN, JobState.RUNNING)
        assert audit(conn) == []
        row = retry(conn, "default", job)
        assert (row.ready, row.cancelled, row.succeeded) == (4, 0, 1)
        items = list_items(conn, "default", job, states=[ItemState.READY]).rows
        assert {(item.attempts, item.solo, item.problem, item.finished) for item in items} == {(0, False, None, None)}
        assert audit(conn) == []
    assert len(commit_all(engine, claim_some(engine))) == 4


def test_retry_starts_an_ended_job_that_was_paused_and_keeps_an_open_one_paused(engine: sa.Engine) -> None:
    ended = finish(engine, failed=1, left=1)
    last = claim_some(engine)
    open_still = finish(engine, failed=1, left=1)
    with transaction(engine) as conn:
        for job in (ended, open_still):
            pause(conn, "default", job)
        fail_items(conn, last.lease_token, [ItemFailure(last.items[0].id, PROBLEM, retryable=False)])
        assert retry(conn, "default", ended).state is JobState.RUNNING
        assert retry(conn, "default", open_still).state is JobState.PAUSED
        assert audit(conn) == []


def test_retry_of_a_job_without_such_items_is_a_conflict(engine: sa.Engine) -> None:
    job = finish(engine, succeeded=2)
    with transaction(engine) as conn, pytest.raises(Conflict, match="no item of this job can be retried"):
        retry(conn, "default", job)


def test_pause_and_resume_say_no_to_a_job_that_has_ended(engine: sa.Engine) -> None:
    job = finish(engine, succeeded=1)
    with transaction(engine) as conn:
        for verb in (pause, resume):
            with pytest.raises(Conflict, match="succeeded"):
                verb(conn, "default", job)


def test_verbs_that_change_nothing_write_no_event(engine: sa.Engine) -> None:
    job = submit_items(engine, 1)
    with transaction(engine) as conn:
        seq = pause(conn, "default", job).event_seq
        assert pause(conn, "default", job).event_seq == seq
        seq = resume(conn, "default", job).event_seq
        assert resume(conn, "default", job).event_seq == seq


def test_resume_wakes_the_queues_that_have_something_to_do(engine: sa.Engine, database_url: str) -> None:
    job = submit_items(engine, 2)
    parse_texts(engine)
    with transaction(engine) as conn:
        pause(conn, "default", job)
    with Listener(database_url, (QUEUE_CHANNEL,)) as listener:
        with transaction(engine) as conn:
            resume(conn, "default", job)
        assert [note.payload for note in listener.wait(5)] == ["hgm3"], "the text queue is empty"
        claim_some(engine, limit=2)
        for verb in (pause, resume):
            with transaction(engine) as conn:
                verb(conn, "default", job)
        assert listener.wait(0.1) == []


def test_priority_and_comment_are_kept_and_told(engine: sa.Engine) -> None:
    job = submit_items(engine, 1)
    with transaction(engine) as conn:
        assert set_priority(conn, "default", job, 7).priority == 7
        assert set_comment(conn, "default", job, "for Monday").comment == "for Monday"
        assert set_comment(conn, "default", job, None).comment is None
        told, *others = events_after(conn, "default", job, 1)
        assert (told.kind, told.data["priority"]) == ("priority", 7)
        assert [event.kind for event in others] == ["comment", "comment"]
        for priority in (-1001, 1001):
            with pytest.raises(InvalidInput, match="1000"):
                set_priority(conn, "default", job, priority)


def test_a_running_job_is_told_to_fail_early_and_does_at_once_if_too_much_has_failed(engine: sa.Engine) -> None:
    job = finish(engine, succeeded=3, failed=1, left=4)
    with transaction(engine) as conn:
        for share in (-0.1, 1.1, float("nan")):
            with pytest.raises(InvalidInput, match="not a share"):
                set_fail_early(conn, "default", job, share)
        for share in (1.0, 0.5):
            assert set_fail_early(conn, "default", job, share).ready == 4
        assert set_fail_early(conn, "default", job, None).fail_early is None
        row = set_fail_early(conn, "default", job, 0.1, "it is dear")
        assert (row.fail_early, row.ready, row.cancelled, row.state) == (0.1, 0, 4, JobState.PARTIAL)
        told = [event.reason for event in events_after(conn, "default", job)]
        assert "fails early above a share of 0.1: it is dear" in told
        assert "1 of 8 items failed, more than the share of 0.1 allowed" in told
        assert audit(conn) == []


@pytest.mark.parametrize("left", [0, 1])
def test_failing_early_cancels_the_last_open_item_and_nothing_of_a_job_without_one(
    engine: sa.Engine, left: int
) -> None:
    job = finish(engine, failed=1, succeeded=1, left=left)
    with transaction(engine) as conn:
        row = set_fail_early(conn, "default", job, 0.0)
        assert (row.ready, row.cancelled, row.state) == (0, left, JobState.PARTIAL)
        assert [event.kind for event in events_after(conn, "default", job)].count("cancelled") == left


def test_delete_takes_everything_of_an_ended_job_and_of_no_other(engine: sa.Engine) -> None:
    kept, job, running = finish(engine, succeeded=1), finish(engine, succeeded=2, failed=1), finish(engine, left=1)
    with transaction(engine) as conn:
        with pytest.raises(Conflict, match="Cancel it first"):
            delete(conn, "default", running)
        delete(conn, "default", job)
        with pytest.raises(NotFound):
            get_job(conn, "default", job)
        assert {motion.job for motion in list_motions(conn, "default").rows} == {kept}
        assert {row.id for row in list_jobs(conn, "default").rows} == {kept, running}
        assert audit(conn) == []


Verb = Callable[[sa.Connection, str, UUID], object]
VERBS: dict[str, Verb] = {
    "pause": pause,
    "resume": resume,
    "cancel": cancel,
    "retry": retry,
    "delete": delete,
    "set_priority": lambda conn, tenant, job: set_priority(conn, tenant, job, 1),
    "set_fail_early": lambda conn, tenant, job: set_fail_early(conn, tenant, job, 0.5),
    "set_comment": lambda conn, tenant, job: set_comment(conn, tenant, job, "x"),
    "get_job": get_job,
    "list_items": list_items,
    "list_motions": lambda conn, tenant, job: list_motions(conn, tenant, job=job),
    "events_after": events_after,
}


@pytest.mark.parametrize("verb", VERBS.values(), ids=VERBS)
def test_a_job_of_another_tenant_is_not_there(engine: sa.Engine, verb: Verb) -> None:
    job = finish(engine, failed=1)
    with transaction(engine) as conn:
        for tenant, identifier in (("studio", job), ("default", uuid4())):
            with pytest.raises(NotFound, match=str(identifier)):
                verb(conn, tenant, identifier)


# --- listings ---


def pages(read: Callable[[str | None], Page[object]]) -> list[object]:
    """All rows, page by page."""
    page = read(None)
    rows = list(page.rows)
    while page.cursor is not None:
        page = read(page.cursor)
        assert page.rows
        rows += page.rows
    return rows


def test_pages_of_items_come_in_input_order_without_gaps(engine: sa.Engine) -> None:
    job = submit_items(engine, 23)
    with transaction(engine) as conn:
        rows = pages(lambda cursor: list_items(conn, "default", job, cursor=cursor, limit=5))  # pyright: ignore
        assert [row.position for row in rows] == list(range(23))  # pyright: ignore


def test_pages_of_jobs_come_newest_first_and_by_state(engine: sa.Engine) -> None:
    jobs: list[UUID] = []
    for n in range(7):
        jobs.append(finish(engine, succeeded=1) if n % 3 else submit_items(engine, 1))
        if n % 3 == 0:
            with transaction(engine) as conn:
                cancel(conn, "default", jobs[-1])
    with transaction(engine) as conn:
        rows = pages(lambda cursor: list_jobs(conn, "default", cursor=cursor, limit=3))  # pyright: ignore
        assert [row.id for row in rows] == jobs[::-1]  # pyright: ignore
        done = list_jobs(conn, "default", states=[JobState.SUCCEEDED]).rows
        assert [row.id for row in done] == [job for n, job in enumerate(jobs) if n % 3][::-1]


def test_pages_of_motions_come_newest_first_and_of_a_job_in_order(engine: sa.Engine) -> None:
    first, second = finish(engine, succeeded=5), finish(engine, succeeded=5)
    with transaction(engine) as conn:
        rows = pages(lambda cursor: list_motions(conn, "default", cursor=cursor, limit=3))  # pyright: ignore
        assert [row.job for row in rows] == [second] * 5 + [first] * 5  # pyright: ignore
        assert len({row.id for row in rows}) == 10  # pyright: ignore
        of_job = pages(lambda cursor: list_motions(conn, "default", job=first, cursor=cursor, limit=2))  # pyright: ignore
        assert [row.id for row in of_job] == [row.id for row in rows[5:]][::-1]  # pyright: ignore
        motion = get_motion(conn, "default", rows[0].id)  # pyright: ignore
        assert motion == rows[0]
        for tenant, identifier in (("studio", motion.id), ("default", uuid4())):
            with pytest.raises(NotFound):
                get_motion(conn, tenant, identifier)


@pytest.mark.parametrize("cursor", ["", "x", "!!", "AAAA", "bm90IGEgbnVtYmVy", "\0", "ü"])
def test_a_foreign_cursor_is_refused(engine: sa.Engine, cursor: str) -> None:
    job = submit_items(engine, 1)
    with transaction(engine) as conn:
        for read in (
            lambda: list_jobs(conn, "default", cursor=cursor),
            lambda: list_items(conn, "default", job, cursor=cursor),
            lambda: list_motions(conn, "default", cursor=cursor),
        ):
            with pytest.raises(InvalidInput, match="not a cursor"):
                read()


@pytest.mark.parametrize("limit", [0, -1, 1001])
def test_a_page_holds_one_to_a_thousand_rows(engine: sa.Engine, limit: int) -> None:
    with transaction(engine) as conn, pytest.raises(InvalidInput, match="limit"):
        list_jobs(conn, "default", limit=limit)


def test_two_prompts_of_one_index_are_variants_in_a_listing(engine: sa.Engine) -> None:
    job = submit_items(engine, [new_item(0, "walk"), new_item(0, "walk", variant=1), new_item(1, "run")])
    with transaction(engine) as conn:
        assert [(row.index, row.variant) for row in list_items(conn, "default", job).rows] == [(0, 0), (0, 1), (1, 0)]
