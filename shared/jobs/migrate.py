"""Bring a database to a revision (Alembic, scripts in `migrations/`)."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import sqlalchemy as sa
from alembic import command
from alembic.config import Config
from alembic.runtime.migration import MigrationContext
from alembic.script import ScriptDirectory

from shared.errors import Conflict
from shared.jobs.database import transaction

LOCK = 0x6D61726579  # "marey": the advisory lock that migrations take


def upgrade(engine: sa.Engine, revision: str = "head") -> None:
    """Migrate up, under an advisory lock: several processes may start at once.

    Raises:
        Unreachable: the database does not answer.
    """
    with transaction(engine) as conn:
        command.upgrade(_config(conn), revision)


def downgrade(engine: sa.Engine, revision: str) -> None:
    """Migrate down to a revision ("base" = no tables). What the younger tables held is lost.

    Raises:
        Unreachable: the database does not answer.
    """
    with transaction(engine) as conn:
        command.downgrade(_config(conn), revision)


def check_revision(engine: sa.Engine) -> None:
    """Raise when the database is not at the newest revision.

    Raises:
        Conflict: it is not.
        Unreachable: it does not answer.
    """
    with transaction(engine) as conn:
        found = MigrationContext.configure(conn).get_current_revision()
        newest = ScriptDirectory.from_config(_config(conn)).get_current_head()
    if found != newest:
        raise Conflict(
            f"the database is at revision {found or 'none'}, this version of Marey needs {newest}",
            where="database",
            hint="Run `marey admin migrate`.",
        )


def _config(conn: sa.Connection) -> Config:
    conn.execute(sa.text("SET LOCAL statement_timeout = 0"))
    conn.execute(sa.select(sa.func.pg_advisory_xact_lock(LOCK)))
    found = importlib.util.find_spec("migrations")
    if found is None or found.origin is None:
        raise RuntimeError("the package `migrations` is part of the distribution")
    config = Config()
    config.set_main_option("script_location", str(Path(found.origin).parent).replace("%", "%%"))
    config.attributes["connection"] = conn
    return config
