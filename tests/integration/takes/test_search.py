"""A search of motions: which index each of its statements goes by, and that no way of looking loses a motion."""

from __future__ import annotations

import re
from collections.abc import Iterator
from uuid import UUID

import pytest
import sqlalchemy as sa

from marey.db import transaction
from marey.jobs import MotionRow, Review
from marey.takes import MotionFilter, list_motions, review, searching
from tests.servers.audit import audit
from tests.servers.jobs import claim_some, commit_all, new_item, parse_texts, submit_items

FILTERS = {
    "word": MotionFilter(text="walking"),
    "phrase": MotionFilter(text='"walks slowly"'),
    "not": MotionFilter(text="-walk"),
    "only stop words": MotionFilter(text="the"),
    "name": MotionFilter(name="TAKE"),
    "quotes": MotionFilter(name="o'b\\c"),
    "tags": MotionFilter(tags=["a", "it's"]),
    "word and tag": MotionFilter(text="walk", tags=["a"]),
    "review": MotionFilter(reviews=[Review.KEPT]),
    "new": MotionFilter(unreviewed=True, name="take"),
    "nothing": MotionFilter(text="walk", tags=["b"], reviews=[Review.REJECTED]),
}


@pytest.fixture(scope="module")
def engine(module_database_url: str) -> Iterator[sa.Engine]:
    from marey.db import create_engine, upgrade

    engine = create_engine(module_database_url)
    upgrade(engine)
    yield engine
    engine.dispose()


@pytest.fixture(scope="module")
def jobs(engine: sa.Engine) -> list[UUID]:
    """Two jobs of motions that fit some filters each; some are kept."""
    made: list[UUID] = []
    for _ in range(2):
        items = [
            new_item(
                n,
                ("a person walks slowly", "the man is walking", "slowly he walks", "she bows")[n % 4],
                name=(f"take {n}", "o'b\\c", None)[n % 3],
                tags=((), ("a",), ("a", "it's"))[n % 3],
            )
            for n in range(24)
        ]
        made.append(submit_items(engine, items))
        parse_texts(engine)
        for _ in range(5):
            commit_all(engine, claim_some(engine, limit=5))
    with transaction(engine) as conn:
        kept = [row.id for row in list_motions(conn, "default").rows][::5]
        review(conn, "default", kept, Review.KEPT, by="ann")
        assert audit(conn) == []
    return made


def pages(conn: sa.Connection, found: MotionFilter, job: UUID | None, limit: int) -> list[MotionRow]:
    rows: list[MotionRow] = []
    cursor: str | None = None
    while True:
        page = list_motions(conn, "default", job=job, found=found, cursor=cursor, limit=limit)
        rows += page.rows
        cursor = page.cursor
        if cursor is None:
            return rows


def fits(conn: sa.Connection, row: MotionRow, found: MotionFilter) -> bool:
    """The meaning of the filter, written a second time in plain Python."""
    if found.text is not None:
        query = "SELECT to_tsvector('english', :prompt) @@ websearch_to_tsquery('english', :text)"
        if not conn.execute(sa.text(query), {"prompt": row.prompt, "text": found.text}).scalar_one():
            return False
    if found.name is not None and not (row.name or "").lower().startswith(found.name.lower()):
        return False
    said = not (found.reviews or found.unreviewed) or row.review in found.reviews
    return set(found.tags) <= set(row.tags) and (said or (found.unreviewed and row.review is None))


@pytest.mark.parametrize("walked", [3, searching.WALKED], ids=["through the index", "newest first"])
@pytest.mark.parametrize("name", FILTERS)
def test_pages_hold_what_fits_once_and_in_order_however_it_is_found(
    engine: sa.Engine, jobs: list[UUID], name: str, walked: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(searching, "WALKED", walked)
    with transaction(engine) as conn:
        for job in (None, jobs[0]):
            everything = pages(conn, MotionFilter(), job, 100)
            order = sorted(everything, key=lambda row: (row.created, row.id), reverse=job is None)
            assert everything == order
            expected = [row.id for row in everything if fits(conn, row, FILTERS[name])]
            assert [row.id for row in pages(conn, FILTERS[name], job, 4)] == expected
            assert [row.id for row in pages(conn, FILTERS[name], job, 100)] == expected


@pytest.mark.parametrize("statistics", [False, True], ids=["bulk load", "ANALYZE"])
@pytest.mark.parametrize("name", [name for name in FILTERS if name != "only stop words"])
def test_a_search_has_two_plans_whatever_the_planner_believes(
    engine: sa.Engine, jobs: list[UUID], name: str, statistics: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(searching, "WALKED", 3)
    seen: dict[str, list[str]] = {"recent": [], "matches": [], "near": []}

    def explain(conn: sa.Connection, _cursor: object, statement: str, parameters: object, *_: object) -> None:
        source = statement.removeprefix("SELECT ").partition(".")[0]
        if source in seen:
            raw = conn.connection.cursor()
            raw.execute("EXPLAIN " + statement, parameters)
            seen[source].append("\n".join(row[0] for row in raw.fetchall()))

    with engine.connect() as conn:
        if statistics:
            conn.execute(sa.text("ANALYZE motion_search"))
        cursor = list_motions(conn, "default", limit=1).cursor
        sa.event.listen(engine, "before_cursor_execute", explain)
        list_motions(conn, "default", found=FILTERS[name], cursor=cursor)
        list_motions(conn, "default", found=FILTERS[name], job=jobs[0])
        sa.event.remove(engine, "before_cursor_execute", explain)
        changed = "SELECT name FROM pg_settings WHERE name LIKE 'enable%' AND setting <> reset_val"
        assert conn.execute(sa.text(changed)).scalars().all() == [], "what comes after it is planned freely"
        conn.rollback()
    walk, walk_of_job = seen["recent"]
    assert "Index Scan Backward using ix_motion_search_created" in walk
    assert "Index Scan using ix_motion_search_job" in walk_of_job
    for plan in (walk, walk_of_job):
        assert "Sort" not in plan
    assert seen["matches"]
    for plan in seen["matches"]:
        assert "Bitmap Index Scan on ix_motion_search_filters" in plan
        assert (FILTERS[name].name is not None) == ("motion_name_prefixes" in plan), "many names are one entry"
    for plan in seen["near"]:
        assert re.search(r"Index Scan (Backward )?using ix_motion_search_(created|job) on motion_search", plan)
        assert "Sort" not in plan
    for plan in (plan for plans in seen.values() for plan in plans):
        assert "Seq Scan" not in plan


@pytest.mark.parametrize(("near", "sorts"), [(searching.NEAR, 0), (1, 1)], ids=["by their times", "themselves"])
def test_matches_behind_the_walk_are_read_by_their_times_or_sorted(
    engine: sa.Engine, jobs: list[UUID], near: int, sorts: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Postgres sorts a number by value; a sort of wider rows copies each."""
    seen: list[str] = []

    def note(_conn: object, _cursor: object, statement: str, *_: object) -> None:
        seen.append(statement.partition("\n")[0])

    with engine.connect() as conn:
        newest = list_motions(conn, "default", limit=3)
        found = MotionFilter(text="walk or run or bow")
        expected = [row.id for row in pages(conn, found, None, 100) if row not in newest.rows]
        monkeypatch.setattr(searching, "NEAR", near)
        monkeypatch.setattr(searching._Page, "_among_newest", lambda *_: [])
        sa.event.listen(engine, "before_cursor_execute", note)
        rows = list_motions(conn, "default", found=found, cursor=newest.cursor, limit=100).rows
        sa.event.remove(engine, "before_cursor_execute", note)
        conn.rollback()
    assert [row.id for row in rows] == expected
    assert len(expected) > 1
    assert seen.count("SELECT matches.created_at ") == 1
    assert seen.count("SELECT matches.motion_id ") == sorts


def _give_to_another(conn: sa.Connection, motion: UUID) -> None:
    change = "SET tenant_id = 'zebra', terms = CAST(replace(terms::text, 'tdefault', 'tzebra') AS tsvector)"
    conn.execute(sa.text(f"UPDATE motion_search {change} WHERE motion_id = :id"), {"id": motion})


def test_the_term_of_the_tenant_is_sought_only_where_others_have_motions(
    engine: sa.Engine, jobs: list[UUID], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Intersecting with the list of all motions takes a tenth more."""
    seen: list[str] = []

    def note(_conn: object, _cursor: object, statement: str, parameters: object, *_: object) -> None:
        if statement.startswith("SELECT matches.created_at"):
            seen.append(str(parameters))

    monkeypatch.setattr(searching._Page, "_among_newest", lambda *_: [])
    sa.event.listen(engine, "before_cursor_execute", note)
    with engine.connect() as conn:
        alone = list_motions(conn, "default", found=MotionFilter(text="walk")).rows
        _give_to_another(conn, alone[0].id)
        beside = list_motions(conn, "default", found=MotionFilter(text="walk")).rows
        conn.rollback()
    sa.event.remove(engine, "before_cursor_execute", note)
    assert ["default" in parameters for parameters in seen] == [False, True]
    assert beside == alone[1:]


def test_motions_of_a_tenant_that_has_just_begun_are_not_shown_to_another(
    engine: sa.Engine, jobs: list[UUID], monkeypatch: pytest.MonkeyPatch
) -> None:
    """It has begun between the question whether there are others and the search."""
    monkeypatch.setattr(searching._Page, "_among_newest", lambda *_: [])
    monkeypatch.setattr(searching, "_any_of_others", lambda _: sa.false())
    found = MotionFilter(text="walk")
    with engine.connect() as conn:
        everything = list_motions(conn, "default", found=found).rows
        for motion in everything[::2]:
            _give_to_another(conn, motion.id)
        for limit in (1, 2, 3, 100):
            rows = list_motions(conn, "default", found=found, limit=limit).rows
            assert rows == everything[1::2][:limit]
        conn.rollback()


def test_motions_of_another_tenant_are_not_looked_through(engine: sa.Engine, jobs: list[UUID]) -> None:
    with transaction(engine) as conn:
        for found in (MotionFilter(), MotionFilter(text="walk"), MotionFilter(name="take")):
            assert list_motions(conn, "nobody", found=found).rows == ()


def test_terms_follow_the_item_and_the_review_and_go_with_the_motion(engine: sa.Engine, jobs: list[UUID]) -> None:
    with engine.connect() as conn:
        motion = list_motions(conn, "default", job=jobs[0], limit=1).rows[0]
        conn.execute(
            sa.text("UPDATE item SET prompt = 'she swims', name = 'Water', tags = '{wet}' WHERE id = :id"),
            {"id": motion.item},
        )
        review(conn, "default", [motion.id], Review.REJECTED, by="ann")
        for found in (
            MotionFilter(text="swim"), MotionFilter(name="water"), MotionFilter(tags=["wet"]),
            MotionFilter(reviews=[Review.REJECTED]),
        ):  # fmt: skip
            assert [row.id for row in list_motions(conn, "default", found=found).rows] == [motion.id]
        assert audit(conn) == []
        conn.execute(sa.text("DELETE FROM job WHERE id = :job"), {"job": jobs[0]})
        assert list_motions(conn, "default", found=MotionFilter(text="swim")).rows == ()
        left = conn.execute(sa.text("SELECT count(*) FROM motion_search WHERE job_id = :job"), {"job": jobs[0]})
        assert left.scalar_one() == 0
        conn.execute(sa.text("TRUNCATE motion CASCADE"))
        assert conn.execute(sa.text("SELECT count(*) FROM motion_search")).scalar_one() == 0
        conn.rollback()
