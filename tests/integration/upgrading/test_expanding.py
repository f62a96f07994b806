"""The rule that lets a release run beside the one before it: a migration only adds (docs/how-to/deployment.md)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import pytest
import sqlalchemy as sa
from alembic.script import ScriptDirectory

from marey.db import downgrade, upgrade
from tests.support.marey import MIGRATIONS

REVISIONS = [s.revision for s in ScriptDirectory(str(MIGRATIONS)).walk_revisions()][::-1]

COLUMNS = """
    SELECT table_name, column_name, data_type, is_nullable = 'YES', column_default IS NOT NULL
    FROM information_schema.columns WHERE table_schema = 'public' AND table_name <> 'alembic_version'
"""
CONSTRAINTS = """
    SELECT conname, conrelid::regclass::text, array_agg(attname::text)
    FROM pg_constraint JOIN pg_attribute ON attrelid = conrelid AND attnum = ANY (conkey)
    WHERE connamespace = 'public'::regnamespace AND contype IN ('c', 'f', 'u', 'x') GROUP BY 1, 2, conrelid
    UNION ALL
    SELECT index.relname, indrelid::regclass::text, array_agg(attname::text)
    FROM pg_index JOIN pg_class AS index ON index.oid = indexrelid
         JOIN pg_attribute ON attrelid = indrelid AND attnum = ANY (indkey)
    WHERE indisunique AND NOT indisprimary AND index.relnamespace = 'public'::regnamespace GROUP BY 1, 2, indrelid
"""

JUDGED = {
    "ck_tenant_id": "no release before it made tenants other than `default`",
    "ck_idempotency_made": "an older API writes a job's id alone, which is one of the two",
}
"""New constraints on columns that were there before, and why an older release does not run into them."""


@dataclass(frozen=True)
class Column:
    """A column as the catalogue has it."""

    kind: str
    nullable: bool
    default: bool


Columns = dict[tuple[str, str], Column]
Constraints = dict[str, set[tuple[str, str]]]


def columns_of(engine: sa.Engine) -> Columns:
    with engine.begin() as conn:
        return {(table, name): Column(*rest) for table, name, *rest in conn.execute(sa.text(COLUMNS))}


def constraints_of(engine: sa.Engine) -> Constraints:
    with engine.begin() as conn:
        return {name: {(table, c) for c in columns} for name, table, columns in conn.execute(sa.text(CONSTRAINTS))}


@pytest.fixture
def steps(engine: sa.Engine) -> Iterator[tuple[str, Columns, Columns, Constraints]]:
    """Of each migration: its name, columns before and after it, and constraints that it brings."""
    downgrade(engine, REVISIONS[0])

    def walk() -> Iterator[tuple[str, Columns, Columns, Constraints]]:
        for revision in REVISIONS[1:]:
            before, old = columns_of(engine), constraints_of(engine)
            upgrade(engine, revision)
            new = {name: on for name, on in constraints_of(engine).items() if name not in old}
            yield revision, before, columns_of(engine), new

    return walk()


def test_a_migration_only_adds_so_that_the_release_before_it_works_on(
    steps: Iterator[tuple[str, Columns, Columns, Constraints]],
) -> None:
    judged: set[str] = set()
    for revision, before, after, new in steps:
        tables = {table for table, _ in before}
        for place, column in before.items():
            assert place in after, f"{revision} takes {place} away: an older release reads or writes it"
            assert after[place].kind == column.kind, f"{revision} gives {place} another type"
            assert after[place].nullable or not column.nullable, f"{revision} forbids NULL in {place}"
        for place in after.keys() - before.keys():
            if place[0] in tables:
                column = after[place]
                assert column.nullable or column.default, f"an older release cannot insert without {place}"
        for name, on in new.items():
            if on & before.keys():
                assert name in JUDGED, f"{revision} brings {name} on columns that an older release writes: judge it"
                judged.add(name)
    assert judged == set(JUDGED)
