"""Writes under a lease: fenced, all or nothing, the first result wins."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import replace
from uuid import UUID, uuid4

import pytest
import sqlalchemy as sa

from marey.db import Listener, transaction
from marey.db.database import EVENT_CHANNEL
from marey.jobs import (
    Claim,
    Committed,
    ItemFailure,
    ItemStage,
    ItemState,
    JobState,
    NewItem,
    NewText,
    Policy,
    begin_assets,
    cancel,
    commit_motions,
    commit_texts,
    events_after,
    fail_items,
    get_job,
    list_items,
    release,
    sweep,
)
from marey.jobs.lease_types import PromptScope
from marey.jobs.types import JsonObject
from marey.takes import erase
from tests.servers.audit import audit
from tests.servers.jobs import (
    PROBLEM,
    claim_some,
    commit_all,
    let_expire,
    make_due,
    motion_of,
    new_item,
    parse_texts,
    submit_items,
)

Write = Callable[[sa.Connection, UUID, list[UUID]], Committed]

WRITES: dict[str, Write] = {
    "commit": lambda conn, token, items: commit_motions(conn, token, [motion_of(item) for item in items]),
    "fail": lambda conn, token, items: fail_items(
        conn, token, [ItemFailure(item, PROBLEM, retryable=False) for item in items]
    ),
    "release": lambda conn, token, items: release(conn, token, "stop", items),
}


def ids(claimed: Claim) -> list[UUID]:
    return [item.id for item in claimed.items]


def snapshot(conn: sa.Connection) -> list[object]:
    """Everything a late write could spoil."""
    tables = ("job", "item", "lane", "lease", "motion", "asset", "job_event")
    return [conn.execute(sa.text(f"SELECT * FROM {table} ORDER BY 1, 2")).all() for table in tables]


def test_a_commit_stores_assets_motions_counters_and_one_event(engine: sa.Engine) -> None:
    job = submit_items(engine, 3)
    parse_texts(engine)
    claimed = claim_some(engine)
    assert commit_all(engine, claimed) == ids(claimed)
    with transaction(engine) as conn:
        row = get_job(conn, "default", job)
        items = list_items(conn, "default", job).rows
        events = [event.kind for event in events_after(conn, "default", job)]
        assert conn.execute(sa.text("SELECT DISTINCT state FROM asset")).scalars().all() == ["stored"]
        assert audit(conn) == []
    assert (row.state, row.succeeded, row.finished is not None) == (JobState.SUCCEEDED, 3, True)
    assert events == ["submitted", "state", "progress", "progress", "state"]
    for item in items:
        assert item.motion is not None
        assert (item.motion.frames, item.motion.fps, item.motion.prompt) == (40, 20.0, item.prompt)
        assert [file.format for file in item.motion.files] == ["npz"]


def test_the_second_result_of_an_item_is_thrown_away(engine: sa.Engine) -> None:
    job = submit_items(engine, 2)
    parse_texts(engine)
    claimed = claim_some(engine)
    first, second = ids(claimed)
    commit_all(engine, claimed, [first])
    with transaction(engine) as conn:
        again = commit_motions(conn, claimed.lease_token, [motion_of(first, b"another"), motion_of(second)][:1])
        assert again == Committed((), (first,))
    commit_all(engine, claimed, [second])
    with transaction(engine) as conn:
        assert get_job(conn, "default", job).state is JobState.SUCCEEDED
        assert audit(conn) == []


@pytest.mark.parametrize("write", WRITES.values(), ids=WRITES)
@pytest.mark.parametrize("loss", ["swept", "swept and claimed by another", "cancelled", "never held"])
def test_a_write_without_the_lease_changes_nothing(engine: sa.Engine, write: Write, loss: str) -> None:
    job = submit_items(engine, 3)
    parse_texts(engine)
    claimed = claim_some(engine)
    with transaction(engine) as conn:
        begin_assets(conn, claimed.lease_token, [motion_of(item).files["npz"] for item in ids(claimed)])
    token = claimed.lease_token
    if loss.startswith("swept"):
        let_expire(engine, token)
        sweep(engine)
    if loss.endswith("another"):
        claim_some(engine)
    if loss == "cancelled":
        with transaction(engine) as conn:
            cancel(conn, "default", job)
    if loss == "never held":
        token = uuid4()
    with transaction(engine) as conn:
        before = snapshot(conn)
        assert write(conn, token, ids(claimed)) == Committed((), tuple(ids(claimed)))
        assert snapshot(conn) == before
        assert audit(conn) == []


def test_an_expired_lease_that_nobody_has_swept_still_commits(engine: sa.Engine) -> None:
    submit_items(engine, 2)
    parse_texts(engine)
    claimed = claim_some(engine)
    let_expire(engine, claimed.lease_token)
    assert commit_all(engine, claimed) == ids(claimed)
    assert sweep(engine).leases_lost == 0


def test_a_commit_and_a_sweep_at_once_end_each_item_once(engine: sa.Engine) -> None:
    for _ in range(8):
        submit_items(engine, 4)
    parse_texts(engine)
    claims = [claim_some(engine) for _ in range(8)]
    for claimed in claims:
        with transaction(engine) as conn:
            begin_assets(conn, claimed.lease_token, [motion_of(item).files["npz"] for item in ids(claimed)])
        let_expire(engine, claimed.lease_token)
    written: list[UUID] = []

    def commit(claimed: Claim) -> None:
        with transaction(engine) as conn:
            motions = [motion_of(item) for item in ids(claimed)]
            written.extend(commit_motions(conn, claimed.lease_token, motions).items)

    threads = [threading.Thread(target=commit, args=(claimed,)) for claimed in claims]
    threads += [threading.Thread(target=sweep, args=(engine,)) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    with transaction(engine) as conn:
        succeeded = conn.execute(sa.text("SELECT id FROM item WHERE state = 'succeeded'")).scalars().all()
        assert sorted(succeeded) == sorted(written)
        assert audit(conn) == []


def test_nothing_is_announced_without_a_lease(engine: sa.Engine) -> None:
    submit_items(engine, 1)
    parse_texts(engine)
    claimed = claim_some(engine)
    let_expire(engine, claimed.lease_token)
    sweep(engine)
    with transaction(engine) as conn:
        assert not begin_assets(conn, claimed.lease_token, [motion_of(claimed.items[0].id).files["npz"]])
        assert conn.execute(sa.text("SELECT count(*) FROM asset")).scalar_one() == 0


def test_motions_with_the_same_content_share_an_asset(engine: sa.Engine) -> None:
    submit_items(engine, 3)
    parse_texts(engine)
    claimed = claim_some(engine)
    motions = [motion_of(item, b"the same") for item in ids(claimed)]
    with transaction(engine) as conn:
        begin_assets(conn, claimed.lease_token, [motion.files["npz"] for motion in motions])
        commit_motions(conn, claimed.lease_token, motions)
        assert conn.execute(sa.text("SELECT count(*) FROM asset")).scalar_one() == 1
        assert conn.execute(sa.text("SELECT count(*) FROM motion_file")).scalar_one() == 3


def test_a_commit_of_what_was_not_announced_is_a_bug_and_writes_nothing(engine: sa.Engine) -> None:
    job = submit_items(engine, 1)
    parse_texts(engine)
    claimed = claim_some(engine)
    with pytest.raises(ValueError, match="without begin_assets"), transaction(engine) as conn:
        commit_motions(conn, claimed.lease_token, [motion_of(claimed.items[0].id)])
    with transaction(engine) as conn:
        assert get_job(conn, "default", job).leased == 1


# --- the text stage ---


def test_features_and_the_next_stage_are_committed_together(engine: sa.Engine) -> None:
    job = submit_items(engine, 2)
    claimed = claim_some(engine, "text")
    assert claimed.stage is ItemStage.TEXT
    texts = [NewText(item.id, item.text_key, b"blob") for item in claimed.items]
    with transaction(engine) as conn:
        assert commit_texts(conn, claimed.lease_token, texts).items == tuple(ids(claimed))
    with transaction(engine) as conn:
        assert {item.stage for item in list_items(conn, "default", job).rows} == {ItemStage.GENERATE}
        assert audit(conn) == []
    assert len(claim_some(engine).items) == 2


def test_waiting_items_of_the_same_prompt_go_along(engine: sa.Engine) -> None:
    submit_items(engine, [new_item(0, "walk", variant=n, seed=n) for n in range(5)] + [new_item(1, "run")])
    claimed = claim_some(engine, "text", limit=1)
    item = claimed.items[0]
    with transaction(engine) as conn:
        commit_texts(conn, claimed.lease_token, [NewText(item.id, item.text_key, b"blob")])
        assert audit(conn) == []
    assert len(claim_some(engine).items) == 5
    assert [item.prompt for item in claim_some(engine, "text").items] == ["run"]


def test_an_item_that_waits_for_another_try_goes_along_too(engine: sa.Engine) -> None:
    submit_items(engine, [new_item(0, "walk", variant=n) for n in range(3)])
    failed = claim_some(engine, "text", limit=1)
    with transaction(engine) as conn:
        fail_items(conn, failed.lease_token, [ItemFailure(failed.items[0].id, PROBLEM, retryable=True)])
    claimed = claim_some(engine, "text", limit=1)
    with transaction(engine) as conn:
        commit_texts(conn, claimed.lease_token, [NewText(claimed.items[0].id, claimed.items[0].text_key, b"blob")])
        assert audit(conn) == []
    assert len(claim_some(engine).items) == 3


def test_features_committed_twice_keep_the_first_blob(engine: sa.Engine) -> None:
    first_job, second_job = (submit_items(engine, [new_item(0, "walk", bundle=name)]) for name in ("a@1", "b@1"))
    claims = [claim_some(engine, "text"), claim_some(engine, "text")]
    assert {claimed.job for claimed in claims} == {first_job, second_job}
    for claimed, blob in zip(claims, (b"first", b"second"), strict=True):
        with transaction(engine) as conn:
            commit_texts(conn, claimed.lease_token, [NewText(claimed.items[0].id, claimed.items[0].text_key, blob)])
    with transaction(engine) as conn:
        assert conn.execute(sa.text("SELECT blob FROM text_features")).scalars().all() == [b"first"]
        assert audit(conn) == []


def test_the_marks_of_the_text_stage_do_not_follow_into_the_next(engine: sa.Engine) -> None:
    submit_items(engine, 2)
    let_expire(engine, claim_some(engine, "text").lease_token)
    sweep(engine)
    parse_texts(engine)
    claimed = claim_some(engine)
    assert (len(claimed.items), claimed.solo) == (2, False)


# --- scopes ---

WORDS = {"version": 1, "by": "words", "verdict": "known", "actions": [], "flags": []}
UNKNOWN = WORDS | {"by": "encoder", "verdict": "unknown"}


def undecided(index: int, prompt: str = "a bow", **changes: object) -> NewItem:
    """An item whose scope the words leave to the encoder."""
    return new_item(index, prompt, scope=WORDS, scope_key=f"{prompt} {changes.get('bundle')}", **changes)


def judge_texts(engine: sa.Engine, scope: JsonObject = UNKNOWN) -> list[UUID]:
    """Run the text stage once, with a verdict for the first item."""
    claimed = claim_some(engine, "text", limit=1)
    (item,) = claimed.items
    text = NewText(item.id, item.text_key, b"blob", PromptScope(f"{item.prompt} None", scope))
    with transaction(engine) as conn:
        done = commit_texts(conn, claimed.lease_token, [text])
        assert audit(conn) == []
    return list(done.items)


def scopes_of(engine: sa.Engine, job: UUID) -> list[JsonObject | None]:
    with transaction(engine) as conn:
        return [item.scope for item in list_items(conn, "default", job).rows]


def test_a_verdict_of_the_encoder_replaces_that_of_the_words_for_all_variants(engine: sa.Engine) -> None:
    job = submit_items(engine, [undecided(0, variant=n) for n in range(3)])
    judge_texts(engine)
    assert scopes_of(engine, job) == [UNKNOWN] * 3
    assert {item.scope["verdict"] for item in claim_some(engine).items if item.scope} == {"unknown"}


def test_known_features_do_not_skip_the_verdict_and_known_verdicts_do(engine: sa.Engine) -> None:
    submit_items(engine, [new_item(0, "a bow")])
    parse_texts(engine)
    judged = submit_items(engine, [undecided(0)])
    assert scopes_of(engine, judged) == [WORDS]
    judge_texts(engine)
    again = submit_items(engine, [undecided(0), undecided(1, bundle="other@1")])
    assert scopes_of(engine, again) == [UNKNOWN, WORDS]
    assert [item.bundle for item in claim_some(engine, "text").items] == ["other@1"]


def test_refused_verdicts_are_made_again_so_that_the_item_fails(engine: sa.Engine) -> None:
    submit_items(engine, [undecided(0)], scope="warn")
    judge_texts(engine)
    submit_items(engine, [undecided(0)], scope="refuse")
    assert claim_some(engine, "text").scope == "refuse"


def test_siblings_of_another_bundle_wait_for_a_verdict_of_their_own(engine: sa.Engine) -> None:
    job = submit_items(engine, [undecided(0), undecided(1, bundle="other@1")])
    judge_texts(engine)
    assert scopes_of(engine, job) == [UNKNOWN, WORDS]
    assert [item.bundle for item in claim_some(engine, "text").items] == ["other@1"]


def test_an_erased_prompt_leaves_no_verdict(engine: sa.Engine) -> None:
    job = submit_items(engine, [undecided(0)])
    judge_texts(engine)
    with transaction(engine) as conn:
        cancel(conn, "default", job, "enough")
        erase(conn, "default", job, by="test")
        assert conn.execute(sa.text("SELECT count(*) FROM prompt_scope")).scalar_one() == 0


# --- errors ---


def test_a_permanent_error_ends_the_item_with_its_problem(engine: sa.Engine) -> None:
    job = submit_items(engine, 2)
    parse_texts(engine)
    claimed = claim_some(engine)
    with transaction(engine) as conn:
        fail_items(conn, claimed.lease_token, [ItemFailure(claimed.items[0].id, PROBLEM, retryable=False)])
    commit_all(engine, claimed, [claimed.items[1].id])
    with transaction(engine) as conn:
        assert get_job(conn, "default", job).state is JobState.PARTIAL
        failed = list_items(conn, "default", job, states=[ItemState.FAILED]).rows
        events = [event for event in events_after(conn, "default", job) if event.item == claimed.items[0].id]
        assert audit(conn) == []
    assert [item.problem for item in failed] == [PROBLEM]
    assert [(event.kind, event.reason) for event in events] == [("item_failed", PROBLEM.message)]


def test_a_job_fails_early_only_when_asked_to(engine: sa.Engine) -> None:
    patient, strict = submit_items(engine, 20), submit_items(engine, 20, fail_early=0.1)
    parse_texts(engine)
    for _ in range(2):
        claimed = claim_some(engine, limit=4)
        failures = [ItemFailure(item, PROBLEM, retryable=False) for item in ids(claimed)[:3]]
        with transaction(engine) as conn:
            fail_items(conn, claimed.lease_token, failures[:2])
            assert get_job(conn, "default", claimed.job).cancelled == 0
            fail_items(conn, claimed.lease_token, failures[2:])
        if claimed.job == patient:
            with transaction(engine) as conn:
                cancelled = get_job(conn, "default", patient).cancelled
                assert cancelled == 0
                cancel(conn, "default", patient)
    with transaction(engine) as conn:
        row = get_job(conn, "default", strict)
        assert (row.failed, row.cancelled, row.state) == (3, 17, JobState.FAILED)
        reasons = [event.reason for event in events_after(conn, "default", strict)]
        assert "3 of 20 items failed, more than the share of 0.1 allowed" in reasons
        assert audit(conn) == []


def test_a_commit_wakes_the_followers_of_its_job(engine: sa.Engine, database_url: str) -> None:
    job = submit_items(engine, 1)
    parse_texts(engine)
    claimed = claim_some(engine)
    with Listener(database_url, (EVENT_CHANNEL,)) as listener:
        commit_all(engine, claimed)
        assert [note.payload for note in listener.wait(5)] == [str(job)]


def test_events_are_numbered_in_the_order_of_their_commits(engine: sa.Engine) -> None:
    """A reader that follows with `seq` never misses one: what it sees is always a whole beginning."""
    job = submit_items(engine, 60)
    parse_texts(engine)
    done = threading.Event()
    holes: list[list[int]] = []

    def follow() -> None:
        seen: list[int] = []
        while not done.is_set() or len(seen) < last():
            with transaction(engine) as conn:
                new = [event.seq for event in events_after(conn, "default", job, seen[-1] if seen else 0)]
            seen += new
        if seen != list(range(1, len(seen) + 1)):
            holes.append(seen)

    def last() -> int:
        with transaction(engine) as conn:
            return get_job(conn, "default", job).event_seq

    def work() -> None:
        for _ in range(10):
            commit_all(engine, claim_some(engine, limit=2))

    follower = threading.Thread(target=follow)
    workers = [threading.Thread(target=work) for _ in range(3)]
    for thread in (follower, *workers):
        thread.start()
    for thread in workers:
        thread.join()
    done.set()
    follower.join()
    assert holes == []
    with transaction(engine) as conn:
        assert get_job(conn, "default", job).state is JobState.SUCCEEDED
        assert audit(conn) == []


def test_features_of_another_prompt_are_refused(engine: sa.Engine) -> None:
    submit_items(engine, 1)
    claimed = claim_some(engine, "text")
    text = NewText(claimed.items[0].id, claimed.items[0].text_key, b"blob")
    with pytest.raises(ValueError, match="are not those of item"), transaction(engine) as conn:
        commit_texts(conn, claimed.lease_token, [replace(text, key="another")])


def test_the_delay_before_a_retry_doubles_up_to_five_minutes(engine: sa.Engine) -> None:
    job = submit_items(engine, 1)
    parse_texts(engine)
    rules = Policy(max_attempts=9)
    for _ in range(8):
        claimed = claim_some(engine)
        with transaction(engine) as conn:
            fail_items(conn, claimed.lease_token, [ItemFailure(claimed.items[0].id, PROBLEM, True)], rules=rules)
        make_due(engine)
        sweep(engine)
    with transaction(engine) as conn:
        events = [event for event in events_after(conn, "default", job, 0) if event.kind == "item_retried"]
    assert [event.data["delay"] for event in events] == [5, 10, 20, 40, 80, 160, 300, 300]
