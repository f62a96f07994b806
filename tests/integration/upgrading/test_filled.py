"""Migrations on a database that holds everything: what the older schema can hold is there after each step."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from itertools import count, pairwise
from typing import Any

import pytest
import sqlalchemy as sa
from alembic.script import ScriptDirectory

from marey.db import check_revision, create_engine, downgrade, transaction, upgrade
from marey.jobs import tables
from tests.servers.audit import audit
from tests.servers.jobs import claim_some, commit_all, parse_texts, submit_items
from tests.support.filled import STATES, fill
from tests.support.marey import MIGRATIONS

Row = dict[str, Any]
Tables = dict[str, list[Row]]
numbers = count()
REVISIONS = [s.revision for s in ScriptDirectory(str(MIGRATIONS)).walk_revisions()][::-1]

LOST: dict[str, tuple[str, Callable[[Row], bool]]] = {
    "0007": ("idempotency", lambda row: row["evaluation_id"] is not None),
}
"""Rows that a step down drops though their table stays; all others only lose columns, or go with their table
(docs/how-to/deployment.md)."""


def rows_of(engine: sa.Engine) -> Tables:
    """Every row of every table, in no order of its own."""
    with engine.begin() as conn:
        names = sa.inspect(conn).get_table_names()
        return {
            name: sorted(
                conn.execute(sa.text(f'SELECT to_jsonb(t) FROM "{name}" t')).scalars(),
                key=lambda row: json.dumps(row, sort_keys=True),
            )
            for name in names
            if name != "alembic_version"
        }


def columns_of(engine: sa.Engine) -> dict[str, set[str]]:
    with engine.begin() as conn:
        found = sa.inspect(conn)
        return {name: {c["name"] for c in found.get_columns(name)} for name in found.get_table_names()}


def held(rows: list[Row], columns: set[str]) -> list[str]:
    """Rows as far as these columns go."""
    return sorted(json.dumps({k: v for k, v in row.items() if k in columns}, sort_keys=True) for row in rows)


def check_same(older: Tables, newer: Tables, columns: dict[str, set[str]], step: str) -> None:
    """Assert that all common content is equal."""
    for name, rows in older.items():
        kept = newer[name]
        if step in LOST and LOST[step][0] == name:
            kept = [row for row in kept if not LOST[step][1](row)]
        assert held(rows, columns[name]) == held(kept, columns[name]), f"{name}, step {step}"


@pytest.fixture(scope="module")
def template(module_database_url: str) -> str:
    """URL of a filled database without connections."""
    engine = create_engine(module_database_url)
    fill(engine)
    engine.dispose()
    return module_database_url


@pytest.fixture
def filled(template: str) -> Iterator[sa.Engine]:
    url, name = sa.make_url(template), f"filled_{next(numbers)}"
    server = sa.create_engine(url.set(database="postgres"), isolation_level="AUTOCOMMIT")
    with server.connect() as conn:
        conn.execute(sa.text(f"CREATE DATABASE {name} TEMPLATE {url.database}"))
    engine = create_engine(url.set(database=name).render_as_string(hide_password=False))
    yield engine
    engine.dispose()
    with server.connect() as conn:
        conn.execute(sa.text(f"DROP DATABASE {name} WITH (FORCE)"))
    server.dispose()


def test_the_fill_holds_every_table_and_every_state(filled: sa.Engine) -> None:
    assert [name for name, rows in rows_of(filled).items() if not rows] == []
    with transaction(filled) as conn:
        for (table, column), states in STATES.items():
            found = set(conn.execute(sa.text(f"SELECT DISTINCT {column} FROM {table}")).scalars()) - {None}
            assert found == states, f"{table}.{column}"
        assert audit(conn) == []


def test_each_step_down_and_up_again_keeps_every_row_that_the_older_schema_can_hold(filled: sa.Engine) -> None:
    walked = rows_of(filled)
    for lower, upper in reversed(list(pairwise(REVISIONS))):
        newer = walked
        downgrade(filled, lower)
        walked = rows_of(filled)
        assert set(walked) <= set(newer)
        check_same(walked, newer, columns_of(filled), upper)
        assert upper not in LOST or len(walked[LOST[upper][0]]) < len(newer[LOST[upper][0]])
    assert len(walked["item"]) > 20
    assert len(walked["motion"]) > 5
    for upper in REVISIONS[1:]:
        older, columns = walked, columns_of(filled)
        upgrade(filled, upper)
        walked = rows_of(filled)
        check_same(older, walked, columns, upper)
    check_revision(filled)


def test_work_goes_on_after_a_step_down_and_up_again(filled: sa.Engine) -> None:
    downgrade(filled, REVISIONS[0])
    upgrade(filled)
    job = submit_items(filled, 3, priority=900)
    parse_texts(filled)
    while (found := claim_some(filled)).job != job:  # the work of other tenants comes first
        assert commit_all(filled, found)
    assert len(commit_all(filled, found)) == 3
    with transaction(filled) as conn:
        assert [problem for problem in audit(conn) if "webhook" not in problem] == []
        assert conn.execute(sa.select(tables.job.c.state).where(tables.job.c.id == job)).scalar_one() == "succeeded"
