"""Any filter finds what plain SQL without an index finds, in the same order, page by page, while others write."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager
from dataclasses import replace
from typing import Any
from uuid import UUID

import pytest
import sqlalchemy as sa
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from marey.db import create_engine, transaction, upgrade
from marey.jobs import Review
from marey.takes import MotionFilter, delete, erase, list_motions, listings, reroll, review, searching
from tests.servers.audit import audit
from tests.servers.jobs import claim_some, commit_all, new_item, new_tenant, parse_texts, submit_items

PROMPTS = (
    "a person walks slowly", "the man is walking", "slowly he walks", "she bows", "it's o'clock: run & jump | turn",
    "x:* ! 'quoted' \\ back", "Élan vital ÀÉÎ", "running",
)  # fmt: skip
NAMES = (
    "take 1", "Take 10", "take%", "take_1", "O'b\\c", "ÉLAN", "élan 2", "straße", "a:*", "a & b", None,
    f"{'long ' * 7}1", f"{'Long ' * 7}2", f"{'İ' * 32}a",
)  # fmt: skip
TAGS = ("a", "A", "it's", "b\\", "g:*", "!x", "a | b", "show=one", "ü", "x y")
TEXTS = (
    *("walk", "walking slowly", '"walks slowly"', "walk or bow", "walk -slowly", "-walk", "the", "O'clock", "élan"),
    *("run & jump", "'quoted'", "\\", ":*", '"', '"walks slowly" or running', "zebra", "x:*", "!walk", "-the"),
)

# What a filter means, without `motion_search`.
NAIVE = sa.text("""
    SELECT motion.id FROM motion JOIN item ON item.id = motion.item_id
    WHERE motion.tenant_id = :tenant AND (CAST(:job AS uuid) IS NULL OR motion.job_id = :job)
      AND (CAST(:text AS text) IS NULL
           OR to_tsvector('english', item.prompt) @@ websearch_to_tsquery('english', :text))
      AND (CAST(:name AS text) IS NULL OR starts_with(lower(item.name), lower(:name)))
      AND item.tags @> CAST(:tags AS text[])
      AND (NOT :reviewed OR motion.review = ANY(:reviews) OR (:unreviewed AND motion.review IS NULL))
    ORDER BY motion.created_at, motion.id
""")

begins = st.sampled_from([name for name in NAMES if name]).flatmap(
    lambda name: st.integers(1, len(name)).flatmap(
        lambda size: st.sampled_from([name[:size], name[:size].upper(), name[:size].lower()])
    )
)
filters = st.builds(
    MotionFilter,
    tags=st.lists(st.sampled_from(TAGS), max_size=2, unique=True),
    name=st.none() | begins | st.sampled_from(("%", "_", "zzz", "'", "\\", "take' | 'x")),
    text=st.none() | st.sampled_from(TEXTS),
    reviews=st.lists(st.sampled_from(list(Review)), max_size=2, unique=True),
    unreviewed=st.booleans(),
)


@pytest.fixture(scope="module")
def engine(module_database_url: str) -> Iterator[sa.Engine]:
    engine = create_engine(module_database_url)
    upgrade(engine)
    yield engine
    engine.dispose()


@pytest.fixture(scope="module")
def jobs(engine: sa.Engine) -> list[UUID]:
    """Three jobs of one tenant, one erased, some of another; verdicts, re-rolls, and one deleted."""
    new_tenant(engine, "studio")
    made = [_finished(engine) for _ in range(4)]
    _finished(engine, tenant="studio")
    with transaction(engine) as conn:
        ids = [row.id for row in list_motions(conn, "default", job=made[0]).rows]
        review(conn, "default", ids[::3], Review.KEPT, by="ann")
        review(conn, "default", ids[1::5], Review.REJECTED, by="ann")
        reroll(conn, "default", ids[2::7], lambda item: replace(new_item(item.index, item.prompt)), by="ann")
    _work(engine)
    with transaction(engine) as conn:
        erase(conn, "default", made[1], by="ann")
        delete(conn, "default", made.pop())
        assert audit(conn) == []
    return made


def _finished(engine: sa.Engine, **job: object) -> UUID:
    items = [
        new_item(
            n,
            PROMPTS[n % len(PROMPTS)],
            name=NAMES[n % len(NAMES)],
            tags=tuple({TAGS[n % len(TAGS)], TAGS[n * 7 % len(TAGS)]}) if n % 4 else (),
        )
        for n in range(40)
    ]
    made = submit_items(engine, items, **job)
    _work(engine)
    return made


def _work(engine: sa.Engine) -> None:
    parse_texts(engine)
    with engine.connect() as conn:
        left = conn.execute(sa.text("SELECT count(*) FROM item WHERE finished_at IS NULL")).scalar_one()
    while left > 0:
        left -= len(commit_all(engine, claim_some(engine, limit=7)))


def naive(conn: sa.Connection, found: MotionFilter, job: UUID | None, tenant: str = "default") -> list[UUID]:
    values: dict[str, Any] = {
        "tenant": tenant, "job": job, "text": found.text, "name": found.name, "tags": list(found.tags),
        "reviewed": bool(found.reviews or found.unreviewed), "reviews": [str(each) for each in found.reviews],
        "unreviewed": found.unreviewed,
    }  # fmt: skip
    ids = list(conn.execute(NAIVE, values).scalars())
    return ids[::-1] if job is None else ids


def walked(engine: sa.Engine, found: MotionFilter, job: UUID | None, limit: int) -> Iterator[list[UUID]]:
    """Page by page, each in a transaction of its own."""
    cursor: str | None = None
    while True:
        with transaction(engine) as conn:
            page = list_motions(conn, "default", job=job, found=found, cursor=cursor, limit=limit)
        yield [row.id for row in page.rows]
        cursor = page.cursor
        if cursor is None:
            return


@given(
    found=filters,
    which=st.none() | st.integers(0, 2),
    size=st.integers(1, 9),
    limit=st.integers(0, 40),
    near=st.integers(0, 20),
)
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_filter_finds_what_plain_sql_finds(
    engine: sa.Engine, jobs: list[UUID], monkeypatch: pytest.MonkeyPatch,
    found: MotionFilter, which: int | None, size: int, limit: int, near: int,
) -> None:  # fmt: skip
    job = None if which is None else jobs[which]
    with monkeypatch.context() as patch, engine.connect() as conn:
        patch.setattr(searching, "WALKED", limit)
        patch.setattr(searching, "NEAR", near)
        expected = naive(conn, found, job)
        conn.rollback()
        assert [each for page in walked(engine, found, job, size) for each in page] == expected


@pytest.mark.parametrize("limit", [2, searching.WALKED], ids=["through the index", "newest first"])
def test_pages_lose_and_repeat_nothing_while_others_write(
    engine: sa.Engine, jobs: list[UUID], limit: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(searching, "WALKED", limit)
    found = MotionFilter(text="walk or run or bow")
    _finished(engine)
    with engine.connect() as conn:
        before = naive(conn, found, None)
    seen: list[UUID] = []
    gone: set[UUID] = set()
    for number, page in enumerate(walked(engine, found, None, 5)):
        seen += page
        with transaction(engine) as conn:
            if number % 2:
                review(conn, "default", [before[-2 - number], before[number]], Review.REJECTED, by="ann")
            elif len(gone) < 3 and before[-number - 2] not in seen:
                gone.add(before[-number - 2])
                conn.execute(sa.text("DELETE FROM motion WHERE id = :id"), {"id": before[-number - 2]})
        if number == 1:
            _finished(engine)
    assert len(seen) == len(set(seen))
    assert gone
    assert [each for each in seen if each not in gone] == [each for each in before if each not in gone]


def test_a_page_whose_motions_go_while_it_is_read_does_not_end_the_listing(
    engine: sa.Engine, jobs: list[UUID], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ids are found by one statement and read by another; between them a job may be deleted."""
    job = _finished(engine)
    with engine.connect() as conn:
        before = naive(conn, MotionFilter(), job)
    real = listings.fetching_by_id
    doomed = [before[3:4], before[5:11]]  # one of a page, then all of one

    def after_deleting(conn: sa.Connection) -> AbstractContextManager[None]:
        if doomed:
            with transaction(engine) as other:
                other.execute(sa.text("DELETE FROM motion WHERE id = ANY(:ids)"), {"ids": doomed.pop(0)})
        return real(conn)

    monkeypatch.setattr(listings, "fetching_by_id", after_deleting)
    seen = [each for page in walked(engine, MotionFilter(), job, 5) for each in page]
    assert seen == [*before[:3], before[4], *before[11:]]
