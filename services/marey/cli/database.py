"""Settings and connections of commands that use the database without the API."""

from __future__ import annotations

import getpass
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import sqlalchemy as sa

    from marey.core.settings import Settings
    from marey.tenants import Actor


def settings_here() -> Settings:
    """Return the settings, with the URLs of this home's embedded servers if no database is named.

    Raises:
        InvalidInput: the extra `server` is not installed.
    """
    from marey.core.extras import extra

    with extra("server"):
        from marey.core.settings import settings
        from marey.embedded import postgres_url
    from pydantic import SecretStr

    config = settings()
    if config.database_url is not None:
        return config
    return config.model_copy(update={"database_url": SecretStr(postgres_url(config.home.absolute()))})


def engine_of(config: Settings) -> sa.Engine:
    """Return an engine for the database of `settings_here`."""
    from marey.db import create_engine

    if config.database_url is None:
        raise AssertionError("settings_here fills it")
    return create_engine(config.database_url.get_secret_value(), pool_size=2)


@contextmanager
def connection() -> Iterator[sa.Connection]:
    """Open a transaction in the database of `settings_here`; raises as that.

    Raises:
        Unreachable: the database does not answer.
    """
    config = settings_here()
    from marey.db import transaction

    engine = engine_of(config)
    try:
        with transaction(engine) as conn:
            yield conn
    finally:
        engine.dispose()


def operator() -> Actor:
    """Return the name of the operating-system user, for the audit log."""
    from marey.tenants import Actor

    try:
        name = getpass.getuser()
    except (KeyError, OSError):  # a container's user without a name
        name = "?"
    return Actor(f"marey admin ({name})")
