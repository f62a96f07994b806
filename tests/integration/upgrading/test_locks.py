"""Migrations beside others who use the tables."""

from __future__ import annotations

import threading

import psycopg
import pytest
import sqlalchemy as sa
from alembic.script import ScriptDirectory
from sqlalchemy import event

from marey.core.errors import Conflict
from marey.db import check_revision, downgrade, migrate, upgrade
from tests.support.marey import MIGRATIONS

REVISIONS = [s.revision for s in ScriptDirectory(str(MIGRATIONS)).walk_revisions()][::-1]


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Waits are short: what is waited for never comes within any."""
    monkeypatch.setattr(migrate, "LOCK_SECONDS", 0.05)
    monkeypatch.setattr(migrate, "PAUSE_SECONDS", 0.01)


def test_a_table_in_use_is_not_waited_for_and_nothing_has_changed(engine: sa.Engine, impatient: None) -> None:
    downgrade(engine, "0003")
    with engine.begin() as reader:
        reader.execute(
            sa.text("SELECT count(*) FROM item")
        )  # a report, a dump: it keeps others from altering the table
        with pytest.raises(Conflict, match="a table is in use"):
            upgrade(engine, patience=0.2)
        columns = {column["name"] for column in sa.inspect(reader).get_columns("job")}
        assert "keep_days" not in columns, "the step before it was taken back"
    upgrade(engine)
    check_revision(engine)


def test_a_migration_goes_on_once_the_table_is_free(engine: sa.Engine, impatient: None) -> None:
    downgrade(engine, "0003")
    refused = threading.Event()
    reader = engine.connect()
    reader.execute(sa.text("SELECT count(*) FROM item"))
    event.listen(engine, "rollback", lambda _: refused.set())
    thread = threading.Thread(target=upgrade, args=(engine,))
    thread.start()
    assert refused.wait(60)
    reader.close()
    thread.join(60)
    check_revision(engine)


def test_a_database_of_a_newer_version_serves_an_older_one_which_does_not_migrate_it(engine: sa.Engine) -> None:
    with engine.begin() as conn:
        conn.execute(sa.text("UPDATE alembic_version SET version_num = '9999'"))
    check_revision(engine)
    with pytest.raises(Conflict, match="does not know the database's revision") as refused:
        upgrade(engine)
    assert "newer version" in (refused.value.hint or "")


def test_a_database_that_lacks_something_is_refused(engine: sa.Engine) -> None:
    downgrade(engine, REVISIONS[-2])
    with pytest.raises(Conflict, match=f"at revision {REVISIONS[-2]}, this version of Marey needs {REVISIONS[-1]}"):
        check_revision(engine)


def test_several_that_migrate_at_once_wait_for_each_other_however_long(engine: sa.Engine, impatient: None) -> None:
    downgrade(engine, REVISIONS[-2])
    dsn = sa.make_url(engine.url).set(drivername="postgresql").render_as_string(hide_password=False)
    with psycopg.connect(dsn) as other:
        other.execute("SELECT pg_advisory_xact_lock(%s)", (migrate.LOCK,))
        thread = threading.Thread(target=upgrade, args=(engine,), kwargs={"patience": 0.0})
        thread.start()
        thread.join(0.5)  # ten times as long as a table would be waited for
        assert thread.is_alive()
    thread.join(60)
    check_revision(engine)
