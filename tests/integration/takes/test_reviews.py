"""Keep, reject, re-roll: on rows."""

from __future__ import annotations

import threading
from dataclasses import replace
from uuid import UUID, uuid4

import pytest
import sqlalchemy as sa

from marey.core.errors import Conflict, InvalidInput, NotFound
from marey.db import transaction
from marey.jobs import (
    SEED_LIMIT,
    ItemRow,
    JobState,
    NewItem,
    Review,
    cancel,
    events_after,
    get_job,
    get_motion,
    list_items,
    pause,
)
from marey.takes import MotionFilter, Reroll, delete, list_motions, reroll, review
from tests.servers.audit import audit
from tests.servers.jobs import claim_some, commit_all, new_item, parse_texts, submit_items

BUNDLE = "tiny@0"


def made(engine: sa.Engine, *items: NewItem) -> tuple[UUID, list[UUID]]:
    """A job with all motions made, and they in input order."""
    job = submit_items(engine, items)
    parse_texts(engine)
    if claimed := claim_some(engine):
        commit_all(engine, claimed)
    with transaction(engine) as conn:
        return job, [item.motion.id for item in list_items(conn, "default", job).rows if item.motion]


def again(item: ItemRow) -> NewItem:
    """The item as a new one, as the API makes it of a bundle."""
    return new_item(item.index, item.prompt, name=item.name, seed=item.seed, tags=item.tags, settings=item.settings)


def roll(engine: sa.Engine, *motions: UUID, **more: str) -> list[Reroll]:
    with transaction(engine) as conn:
        return reroll(conn, "default", motions, again, **({"by": "ann"} | more))


def say(engine: sa.Engine, verdict: Review | None, *motions: UUID, by: str = "ann", comment: str | None = None) -> None:
    with transaction(engine) as conn:
        review(conn, "default", motions, verdict, by=by, comment=comment)


def test_a_verdict_stands_with_who_when_and_why_and_in_the_log(engine: sa.Engine) -> None:
    job, (first, second, third) = made(engine, *map(new_item, range(3)))
    say(engine, Review.KEPT, first, second, comment="clean feet")
    with transaction(engine) as conn:
        row = get_motion(conn, "default", first)
        assert (row.review, row.reviewed_by, row.review_comment) == (Review.KEPT, "ann", "clean feet")
        assert row.reviewed is not None
        assert get_motion(conn, "default", third).review is None
        event = events_after(conn, "default", job)[-1]
        assert (event.kind, event.reason) == ("reviewed", "2 motions kept by ann: clean feet")
        assert audit(conn) == []


def test_said_again_nothing_changes_and_another_verdict_replaces_it(engine: sa.Engine) -> None:
    job, (motion,) = made(engine, new_item(0))
    say(engine, Review.KEPT, motion, comment="good")
    with transaction(engine) as conn:
        before, events = get_motion(conn, "default", motion), events_after(conn, "default", job)
    say(engine, Review.KEPT, motion, by="bob")
    with transaction(engine) as conn:
        assert get_motion(conn, "default", motion) == before
        assert events_after(conn, "default", job) == events
    say(engine, Review.KEPT, motion, by="cem", comment="very good")
    with transaction(engine) as conn:
        row = get_motion(conn, "default", motion)
        assert (row.reviewed_by, row.review_comment) == ("cem", "very good")
    say(engine, Review.REJECTED, motion, by="bob")
    with transaction(engine) as conn:
        row = get_motion(conn, "default", motion)
        assert (row.review, row.reviewed_by, row.review_comment) == (Review.REJECTED, "bob", None)
    say(engine, None, motion)
    with transaction(engine) as conn:
        row = get_motion(conn, "default", motion)
        assert (row.review, row.reviewed, row.reviewed_by) == (None, None, None)


def test_a_motion_that_is_not_there_spoils_the_whole_call(engine: sa.Engine) -> None:
    _, (motion,) = made(engine, new_item(0))
    missing = uuid4()
    with pytest.raises(NotFound, match=f"motion {missing}"):
        say(engine, Review.KEPT, motion, missing)
    with pytest.raises(NotFound), transaction(engine) as conn:
        review(conn, "another tenant", [motion], Review.KEPT, by="eve")
    with pytest.raises(InvalidInput, match="comment"):
        say(engine, Review.KEPT, motion, comment="a\0b")
    with pytest.raises(InvalidInput, match="1 to 1000"):
        say(engine, Review.KEPT)
    with transaction(engine) as conn:
        assert get_motion(conn, "default", motion).review is None


def test_a_reroll_is_a_new_item_with_the_next_seed_linked_to_what_it_replaces(engine: sa.Engine) -> None:
    walk = new_item(0, "a person walks", seed=7, name="walk", tags=("shot=010",), settings={"steps": 4})
    job, (first, second, other) = made(engine, walk, replace(walk, variant=1, seed=8), new_item(1))
    takes = roll(engine, second, comment="feet slide")
    assert [(take.motion, take.seed, take.made, take.state) for take in takes] == [(second, 9, True, "ready")]
    with transaction(engine) as conn:
        item = list_items(conn, "default", job).rows[-1]
        assert (item.id, item.position, item.index, item.variant, item.seed) == (takes[0].item, 3, 0, 2, 9)
        assert (item.prompt, item.name, item.tags, item.settings) == (
            "a person walks", "walk", ("shot=010",), {"steps": 4},
        )  # fmt: skip
        assert (item.replaces, item.stage) == (second, "generate")  # its text was read before
        row = get_motion(conn, "default", second)
        assert (row.review, row.review_comment, row.replaced_by) == (Review.REROLLED, "feet slide", item.id)
        assert get_job(conn, "default", job).state is JobState.RUNNING
        assert [event.kind for event in events_after(conn, "default", job)][-2:] == ["rerolled", "state"]
        assert audit(conn) == []
    commit_all(engine, claim_some(engine))
    with transaction(engine) as conn:
        assert get_job(conn, "default", job).state is JobState.SUCCEEDED
        take = list_items(conn, "default", job).rows[-1].motion
        assert take is not None
        assert take.replaces == second
        assert get_motion(conn, "default", first).replaced_by is None
        assert audit(conn) == []
    assert [t.seed for t in roll(engine, take.id, other)] == [10, 2]  # and so on, each prompt by its own seeds
    with transaction(engine) as conn:
        cancel(conn, "default", job)
        delete(conn, "default", job)
        assert conn.execute(sa.text("SELECT count(*) FROM item")).scalar_one() == 0


def test_a_reroll_asked_for_twice_or_by_two_at_once_is_made_once(engine: sa.Engine) -> None:
    job, motions = made(engine, *map(new_item, range(3)))
    barrier, answers = threading.Barrier(4), []

    def ask() -> None:
        barrier.wait(20)
        answers.append(roll(engine, *motions))

    threads = [threading.Thread(target=ask) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len({tuple(take.item for take in takes) for takes in answers}) == 1
    assert sum(take.made for takes in answers for take in takes) == 3
    with transaction(engine) as conn:
        assert get_job(conn, "default", job).total == 6
        assert audit(conn) == []


def test_the_seed_after_the_greatest_is_the_first_that_is_free(engine: sa.Engine) -> None:
    last = new_item(0, seed=SEED_LIMIT - 1)
    _, motions = made(engine, last, replace(last, variant=1, seed=0))
    assert [take.seed for take in roll(engine, *motions)] == [1, 2]


def test_a_paused_job_stays_paused_and_a_cancelled_one_goes_on_for_its_take(engine: sa.Engine) -> None:
    job = submit_items(engine, 2)
    parse_texts(engine)
    commit_all(engine, claim_some(engine, limit=1))
    with transaction(engine) as conn:
        pause(conn, "default", job)
        (motion,) = list_motions(conn, "default", job=job).rows
    roll(engine, motion.id)
    with transaction(engine) as conn:
        assert get_job(conn, "default", job).state is JobState.PAUSED
        cancel(conn, "default", job)
    (take,) = roll(engine, motion.id)
    assert (take.made, take.state) == (False, "cancelled")  # `retry` is for that
    with transaction(engine) as conn:
        assert audit(conn) == []


def test_what_cannot_be_made_again_is_refused(engine: sa.Engine) -> None:
    _, (clip,) = made(engine, new_item(0))
    with transaction(engine) as conn:
        conn.execute(sa.text("""UPDATE motion SET metadata = '{"stream": "x"}'"""))
    with pytest.raises(Conflict, match="clip of a live stream"):
        roll(engine, clip)
    job, (motion,) = made(engine, new_item(0))
    with transaction(engine) as conn:
        conn.execute(sa.text("UPDATE job SET erased_at = now() WHERE id = :job"), {"job": job})
    with pytest.raises(Conflict, match="erased"):
        roll(engine, motion)
    with transaction(engine) as conn:
        assert get_job(conn, "default", job).total == 1


def test_motions_are_found_by_all_that_is_asked(engine: sa.Engine) -> None:
    items = (
        new_item(0, "a person walks slowly", name="Walk_010", tags=("shot=010", "show=nox")),
        new_item(1, "an old man is walking and waving", name="walk_020", tags=("shot=020", "show=nox")),
        new_item(2, "someone runs 100% of the way", name="w%lk", tags=("shot=010",)),
        new_item(3, "a person bows"),
    )
    _, motions = made(engine, *items)
    say(engine, Review.KEPT, motions[0], motions[2])

    def found(**asked: object) -> list[int]:
        with transaction(engine) as conn:
            return sorted(row.index for row in list_motions(conn, "default", found=MotionFilter(**asked)).rows)

    assert found(tags=["shot=010"]) == [0, 2]
    assert found(tags=["show=nox", "shot=010"]) == [0]
    assert found(tags=["shot"]) == []
    assert found(name="WALK") == [0, 1]
    assert found(name="w%") == [2]
    assert found(text="walk") == [0, 1]
    assert found(text="waving walks") == [1]
    assert found(text="walk -old") == [0]
    assert found(text='"person walks" or bow') == [0, 3]
    assert found(text="'); DROP TABLE item; --") == []
    assert found(reviews=[Review.KEPT]) == [0, 2]
    assert found(reviews=[Review.KEPT], unreviewed=True, text="person") == [0, 3]
    assert found(unreviewed=True) == [1, 3]
    for wrong in ({"text": "a\0"}, {"name": "\ud800"}, {"tags": ["\0"]}):
        with pytest.raises(InvalidInput):
            found(**wrong)
