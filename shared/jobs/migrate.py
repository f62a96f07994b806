"""Bring a database to a revision (Alembic, scripts in `migrations/`)."""

from __future__ import annotations

import sqlalchemy as sa


def upgrade(engine: sa.Engine, revision: str = "head") -> None:
    """Migrate up, under an advisory lock: several processes may start at once.

    Raises:
        Unreachable: the database does not answer.
    """
    raise NotImplementedError


def downgrade(engine: sa.Engine, revision: str) -> None:
    """Migrate down to a revision ("base" = an empty database)."""
    raise NotImplementedError


def check_revision(engine: sa.Engine) -> None:
    """Raises:
    Conflict: the database is not at the newest revision.
    """
    raise NotImplementedError
