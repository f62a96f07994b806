"""The engine and transactions. SQLAlchemy Core over psycopg 3, synchronous."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import contextmanager
from typing import Any

import psycopg
import sqlalchemy as sa
from sqlalchemy import event, exc

from marey.core.errors import Unreachable
from marey.db.connections import ConnectionGroup, DeadlineConnection, group_of, milliseconds, open_connection
from marey.db.deadlines import ORDINARY, PING_SECONDS, Deadline

QUEUE_CHANNEL = "marey_queue"
"""NOTIFY channel: items of the queue in the payload became ready."""
EVENT_CHANNEL = "marey_event"
"""NOTIFY channel: the job in the payload has new events."""

POOL_SECONDS = 10
"""Seconds that a thread waits for a free connection of the pool."""
GROUP, DEADLINE = "marey_group", "marey_deadline"
"""Execution options of an engine: its connection group, and the limits its sessions are set up with."""
SNAPSHOT = sa.text("SET TRANSACTION ISOLATION LEVEL REPEATABLE READ READ ONLY")
SET_LOCAL = "SET LOCAL statement_timeout = {}; SET LOCAL idle_in_transaction_session_timeout = {}"
"""No query: a transaction may still choose its isolation level afterwards."""


def create_engine(url: str, *, pool_size: int = 5, max_overflow: int = 10, deadline: Deadline = ORDINARY) -> sa.Engine:
    """Create an engine for `postgresql+psycopg://…` (plain `postgresql://` is taken as the same).

    Connections are checked before use, so a restarted server costs no failed transaction. Every round trip has a
    deadline (`marey.db.deadlines`); `deadline` is the default for transactions.
    """
    parsed = sa.make_url(url).set(drivername="postgresql+psycopg")
    group = group_of(parsed)
    engine = sa.create_engine(
        parsed,
        pool_size=pool_size,
        max_overflow=max_overflow,
        pool_pre_ping=True,
        hide_parameters=True,  # error texts are logged, and parameters hold prompts
        pool_timeout=POOL_SECONDS,
        connect_args={"application_name": "marey"},
        execution_options={GROUP: group, DEADLINE: deadline},
    )

    @event.listens_for(engine, "do_connect")
    def _connect(_dialect: object, _record: object, arguments: list[Any], options: dict[str, Any]) -> Any:
        return open_connection(group, deadline, *arguments, **options)

    @event.listens_for(engine, "checkout")
    def _check_out(connection: DeadlineConnection, _record: object, _fairy: object) -> None:
        connection.limit = deadline.answer  # after the pre-use check, which has the limit of a ping
        group.answered()

    @event.listens_for(engine, "checkin")
    def _check_in(connection: DeadlineConnection | None, _record: object) -> None:
        if connection is not None:
            connection.limit = PING_SECONDS

    return engine


@contextmanager
def transaction(
    engine: sa.Engine, deadline: Deadline | None = None, *, snapshot: bool = False
) -> Generator[sa.Connection]:
    """Run a block in one transaction: commit at the end, roll back on an exception.

    Args:
        deadline: kind of the transaction's calls (`marey.db.deadlines`); None = the engine's.
        snapshot: every statement sees the database as of the first one; read-only.

    Raises:
        Unreachable: the database does not answer, or the connection broke (nothing is written then, except if it
            broke during the commit: the caller's idempotency key or lease token resolves that).
    """
    options = engine.get_execution_options()
    group: ConnectionGroup = options[GROUP]
    chosen: Deadline = deadline or options[DEADLINE]
    try:
        with group.turn():
            connection = engine.connect()
        with connection, connection.begin():
            if snapshot:
                connection.execute(SNAPSHOT)  # Postgres accepts it only before any other statement
            _limit(connection, chosen)
            yield connection
    except (exc.OperationalError, exc.TimeoutError, psycopg.OperationalError) as error:
        raise unreachable(error) from error
    except exc.DBAPIError as error:
        if error.connection_invalidated:
            raise unreachable(error) from error
        raise


def _limit(connection: sa.Connection, deadline: Deadline) -> None:
    """Apply the limits of a kind of call to the transaction that begins; costs a round trip if the session has others.

    Always behind a pooler: the session may be any.
    """
    driver = connection.connection.driver_connection
    assert isinstance(driver, DeadlineConnection)
    driver.limit = deadline.answer
    if driver.pooled or driver.deadline != deadline:
        connection.exec_driver_sql(SET_LOCAL.format(*milliseconds(deadline)))


def outages(engine: sa.Engine) -> int:
    """Return how often this process found the database of `engine` silent: an outage that retries may have hidden."""
    return engine.get_execution_options()[GROUP].misses


def unreachable(error: BaseException) -> Unreachable:
    """Return the expected error for a database that does not answer, or has no free connection."""
    cause = getattr(error, "orig", None) or error
    if isinstance(cause, psycopg.errors.DiskFull):  # its text names a file of the server
        hint = "Free disk space for Postgres; waiting work resumes by itself."
        message = "the database has no disk space left"
        return Unreachable(message, where="database", hint=hint, public=message)
    if isinstance(cause, psycopg.errors.QueryCanceled):
        hint = "It is overloaded, or another transaction holds a lock for long. Try again."
        message = "the database took too long for a statement"
        return Unreachable(message, where="database", hint=hint, public=message)
    first_line = (str(cause).splitlines() or [type(cause).__name__])[0]
    return Unreachable(
        f"the database does not answer ({first_line})",
        where="database",
        hint="Is it running, and is MAREY_DATABASE_URL right? Embedded: `marey serve` starts it.",
        public="the database does not answer",
    )
