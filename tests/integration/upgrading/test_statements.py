"""Statements of an earlier release's workers are understood by this release's database."""

from __future__ import annotations

from pathlib import Path

import psycopg
import pytest
import sqlalchemy as sa

from tests.support.statements import FOLDER, work

RECORDED = sorted(FOLDER.glob("*.sql"))


def statements_of(file: Path) -> list[str]:
    return [line.removesuffix(";") for line in file.read_text(encoding="utf-8").splitlines()]


@pytest.mark.parametrize("file", RECORDED, ids=lambda file: file.stem)
def test_every_statement_of_an_earlier_release_fits_these_tables(engine: sa.Engine, file: Path) -> None:
    """Names and types, as Postgres judges them; that inserts need no more is the business of `test_expanding.py`."""
    statements = statements_of(file)
    assert len(statements) > 30
    dsn = sa.make_url(engine.url).set(drivername="postgresql").render_as_string(hide_password=False)
    with psycopg.connect(dsn, autocommit=True) as conn:
        for number, statement in enumerate(statements):
            conn.execute(f"PREPARE s{number} AS {statement}".encode())


def test_a_statement_that_names_what_is_gone_is_found(engine: sa.Engine) -> None:
    with engine.begin() as conn:
        conn.execute(sa.text("ALTER TABLE worker DROP COLUMN batch_key"))
    with pytest.raises(psycopg.errors.UndefinedColumn, match="batch_key"):
        test_every_statement_of_an_earlier_release_fits_these_tables(engine, RECORDED[-1])


def test_what_is_recorded_is_what_workers_say(engine: sa.Engine) -> None:
    """A recording that lost half of them would check nothing: this release says most of the same."""
    said = work(engine)
    before = set(statements_of(RECORDED[-1]))
    assert len(said & before) > 0.5 * len(said)
