"""Migrations: up, down, up again; what they make is what the code expects."""

from __future__ import annotations

import threading

import pytest
import sqlalchemy as sa
from alembic.autogenerate import compare_metadata
from alembic.config import Config
from alembic.runtime.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy.types import NullType

from marey.core.errors import Conflict
from marey.db import check_revision, create_engine, downgrade, migrate, upgrade
from marey.db.deadlines import MIGRATION
from marey.migrations.tables import metadata
from tests.servers.jobs import submit_items
from tests.support.marey import MIGRATIONS


def things_in(engine: sa.Engine) -> dict[str, list[str]]:
    """Names of everything in the schema `public`."""
    queries = {
        "relations": "SELECT relname FROM pg_class WHERE relnamespace = 'public'::regnamespace ORDER BY 1",
        "functions": "SELECT proname FROM pg_proc WHERE pronamespace = 'public'::regnamespace ORDER BY 1",
        "types": "SELECT typname FROM pg_type WHERE typnamespace = 'public'::regnamespace ORDER BY 1",
    }
    with engine.begin() as conn:
        return {kind: list(conn.execute(sa.text(query)).scalars()) for kind, query in queries.items()}


def test_the_migrated_database_is_the_one_in_the_code(engine: sa.Engine) -> None:
    with engine.begin() as conn:
        context = MigrationContext.configure(conn, opts={"compare_server_default": True, "compare_type": True})
        assert compare_metadata(context, metadata) == []


def test_checks_generated_columns_and_indexes_are_those_in_the_code(engine: sa.Engine) -> None:
    """Compare properties that Alembic ignores: the tables are made a second time, from the code."""
    query = sa.text(
        "SELECT conrelid::regclass::text, conname::text, pg_get_constraintdef(oid) FROM pg_constraint "
        "WHERE connamespace = current_schema::regnamespace AND conrelid <> 0 UNION ALL "
        "SELECT table_name, column_name, generation_expression FROM information_schema.columns "
        "WHERE table_schema = current_schema AND is_generated = 'ALWAYS' UNION ALL "
        "SELECT tablename, indexname, regexp_replace(indexdef, ' ON [a-z_]+[.]', ' ON ') FROM pg_indexes "
        "WHERE schemaname = current_schema ORDER BY 1, 2, 3"
    )
    with engine.begin() as conn:
        migrated = [tuple(row) for row in conn.execute(query) if "alembic" not in row[0]]
        conn.execute(sa.text("CREATE SCHEMA code"))
        conn.execute(sa.text("SET LOCAL search_path = code, public"))  # functions come from the migrations
        metadata.create_all(conn, checkfirst=False)
        coded = [tuple(row) for row in conn.execute(query)]
    assert coded == migrated
    assert len(coded) > 60


def test_the_names_of_the_scripts_give_their_revisions() -> None:
    scripts = list(ScriptDirectory(str(MIGRATIONS)).walk_revisions())[::-1]
    assert migrate.revisions() == [script.revision for script in scripts]


def test_down_leaves_nothing_and_up_again_makes_the_same(engine: sa.Engine) -> None:
    before = things_in(engine)
    submit_items(engine, 3)
    downgrade(engine, "base")
    left = things_in(engine)
    assert left["functions"] == []
    assert all("alembic_version" in name for name in left["relations"] + left["types"])
    with pytest.raises(Conflict, match="marey admin migrate"):
        check_revision(engine)
    upgrade(engine)
    assert things_in(engine) == before
    check_revision(engine)
    submit_items(engine, 3)


def test_upgrading_twice_and_from_several_processes_at_once_is_fine(engine: sa.Engine, database_url: str) -> None:
    downgrade(engine, "base")
    errors: list[BaseException] = []

    def start() -> None:
        own = create_engine(database_url)
        try:
            upgrade(own)
        except BaseException as error:
            errors.append(error)
        own.dispose()

    threads = [threading.Thread(target=start) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert errors == []
    upgrade(engine)
    check_revision(engine)


def test_every_column_has_a_type() -> None:
    """The comparison with the database leaves out what has none."""
    columns = [column for table in metadata.tables.values() for column in table.columns]
    assert [column for column in columns if isinstance(column.type, NullType)] == []


def test_a_migration_may_take_longer_than_other_transactions(
    engine: sa.Engine, monkeypatch: pytest.MonkeyPatch
) -> None:
    found: list[int] = []

    def look(config: Config, _revision: str) -> None:
        setting = "SELECT setting::int FROM pg_settings WHERE name = 'statement_timeout'"
        found.append(config.attributes["connection"].execute(sa.text(setting)).scalar_one())

    monkeypatch.setattr("alembic.command.upgrade", look)
    upgrade(engine)
    assert found == [MIGRATION.statement * 1000]
