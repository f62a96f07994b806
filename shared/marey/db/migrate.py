"""Bring a database to a revision (Alembic, scripts in `migrations/`)."""

from __future__ import annotations

import importlib.util
import time
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import psycopg
import sqlalchemy as sa

from marey.core.errors import Conflict, Unreachable
from marey.core.versions import check_postgres
from marey.db.database import transaction
from marey.db.deadlines import MIGRATION

if TYPE_CHECKING:
    from alembic.config import Config

LOCK = 0x6D61726579  # "marey": the advisory lock that migrations take
LOCK_SECONDS = 3.0
"""A statement that waits longer for a table's lock fails: every later statement on that table queues behind it."""
PATIENCE = 60.0
"""Seconds for which the migration is retried after that."""
PAUSE_SECONDS = 2.0
VERSION = sa.cast(sa.func.current_setting("server_version_num"), sa.Integer)


def upgrade(engine: sa.Engine, revision: str = "head", *, patience: float = PATIENCE) -> None:
    """Migrate up, all or nothing, under an advisory lock: several processes may start at once.

    Raises:
        Conflict: another transaction locked a table for `patience` seconds, the database is of a newer version, or
            its server is too old.
        Unreachable: the database does not answer.
    """
    _migrate(engine, "upgrade", revision, patience)


def downgrade(engine: sa.Engine, revision: str, *, patience: float = PATIENCE) -> None:
    """Migrate down to a revision ("base" = no tables). Data of the younger tables and columns is lost.

    Raises:
        Conflict: another transaction locked a table for `patience` seconds, or the database is of a newer version.
        Unreachable: the database does not answer.
    """
    _migrate(engine, "downgrade", revision, patience)


def _migrate(engine: sa.Engine, move: Literal["upgrade", "downgrade"], revision: str, patience: float) -> None:
    from alembic import command  # few processes migrate, and all import this module
    from alembic.util import CommandError

    until = time.monotonic() + patience
    while True:
        try:
            with transaction(engine, MIGRATION) as conn:
                getattr(command, move)(_config(conn), revision)
            return
        except Unreachable as error:
            if not isinstance(getattr(error.__cause__, "orig", None), psycopg.errors.LockNotAvailable):
                raise
            if time.monotonic() > until:
                raise Conflict(
                    f"a table is in use: the migration gave up after {patience:g} seconds, and changed nothing",
                    where="database",
                    hint="See the oldest transaction in `pg_stat_activity` (a backup, a report?); try again after it.",
                ) from error
        except CommandError as error:
            raise Conflict(
                f"this version of Marey does not know the database's revision ({error})",
                where="database",
                hint="The database is of a newer version. Migrate with that version.",
            ) from error
        time.sleep(PAUSE_SECONDS)


def check_revision(engine: sa.Engine) -> None:
    """Raise if the database lacks tables or columns that this version needs.

    A database of a newer version is fine: migrations only add, and an upgrade migrates first
    (docs/how-to/deployment.md).

    Raises:
        Conflict: the database is older, or not migrated at all, or its server is too old.
        Unreachable: the database does not answer.
    """
    with transaction(engine) as conn:
        table, version = conn.execute(sa.select(sa.func.to_regclass("alembic_version"), VERSION)).one()
        check_postgres(version)
        found = table and conn.execute(sa.text("SELECT version_num FROM alembic_version")).scalar_one_or_none()
    *older, newest = revisions()
    if found is None or found in older:
        raise Conflict(
            f"the database is at revision {found or 'none'}, this version of Marey needs {newest}",
            where="database",
            hint="Run `marey admin migrate`.",
        )


def revisions() -> list[str]:
    """Return all revisions, oldest first: the name of each script begins with its own."""
    return sorted(script.name.partition("_")[0] for script in (_folder() / "versions").glob("[0-9]*_*.py"))


def _folder() -> Path:
    found = importlib.util.find_spec("marey.migrations")
    if found is None or found.origin is None:
        raise RuntimeError("the package `marey.migrations` is part of the distribution")
    return Path(found.origin).parent


def _config(conn: sa.Connection) -> Config:
    from alembic.config import Config

    check_postgres(conn.execute(sa.select(VERSION)).scalar_one())
    conn.execute(sa.select(sa.func.pg_advisory_xact_lock(LOCK)))
    conn.execute(sa.text(f"SET LOCAL lock_timeout = {int(LOCK_SECONDS * 1000)}"))
    config = Config()
    config.set_main_option("script_location", str(_folder()).replace("%", "%%"))
    config.attributes["connection"] = conn
    return config
