"""The engine, transactions and notifications. SQLAlchemy Core over psycopg 3, synchronous."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass

import psycopg
import sqlalchemy as sa
from psycopg import sql
from sqlalchemy import event, exc

from shared.errors import Unreachable

QUEUE_CHANNEL = "marey_queue"
"""NOTIFY channel: items of the queue in the payload became ready."""
EVENT_CHANNEL = "marey_event"
"""NOTIFY channel: the job in the payload has new events."""

CONNECT_TIMEOUT = 5  # seconds; libpq waits for ever by default
# Beyond any statement of ours (100,000 items cancelled in one take 3 s), short of a hung process.
STATEMENT_TIMEOUT = 60_000  # milliseconds
# A client that was stopped or cut off in the middle must not hold a job's lock for ever.
IDLE_TIMEOUT = 60_000  # milliseconds


def create_engine(url: str, *, pool_size: int = 5, max_overflow: int = 10) -> sa.Engine:
    """An engine for `postgresql+psycopg://…` (plain `postgresql://` is taken as the same).

    Connections are checked before use, so a restarted server costs no failed transaction.
    """
    parsed = sa.make_url(url).set(drivername="postgresql+psycopg")
    engine = sa.create_engine(
        parsed,
        pool_size=pool_size,
        max_overflow=max_overflow,
        pool_pre_ping=True,
        hide_parameters=True,  # an error's text goes to logs, and parameters hold prompts
        pool_timeout=CONNECT_TIMEOUT * 2,
        connect_args={"connect_timeout": CONNECT_TIMEOUT, "application_name": "marey"},
    )

    @event.listens_for(engine, "connect")
    def _set_up(connection: psycopg.Connection[tuple[object, ...]], _record: object) -> None:
        connection.execute("SELECT set_config('statement_timeout', %s, false)", (str(STATEMENT_TIMEOUT),))
        connection.execute("SELECT set_config('idle_in_transaction_session_timeout', %s, false)", (str(IDLE_TIMEOUT),))
        connection.execute("SET timezone = 'UTC'")
        connection.commit()

    return engine


@contextmanager
def transaction(engine: sa.Engine) -> Generator[sa.Connection]:
    """One transaction: commits at the end, rolls back on an exception.

    Raises:
        Unreachable: the database does not answer, or went away in the middle (nothing is written then, unless it went
            away exactly during the commit: the caller's idempotency or lease token sorts that out).
    """
    try:
        with engine.begin() as connection:
            yield connection
    except (exc.OperationalError, exc.TimeoutError, psycopg.OperationalError) as error:
        raise unreachable(error) from error
    except exc.DBAPIError as error:
        if error.connection_invalidated:
            raise unreachable(error) from error
        raise


def unreachable(error: BaseException) -> Unreachable:
    """The expected error for a database that does not answer, or has no room."""
    cause = getattr(error, "orig", None) or error
    if isinstance(cause, psycopg.errors.DiskFull):  # its text names a file of the server
        hint = "Make room on the disk of Postgres; what waits goes on by itself."
        return Unreachable("the database has no room left", where="database", hint=hint)
    first_line = (str(cause).splitlines() or [type(cause).__name__])[0]
    return Unreachable(
        f"the database does not answer ({first_line})",
        where="database",
        hint="Is it running, and is MAREY_DATABASE_URL right? Embedded: `marey serve` starts it.",
    )


@dataclass(frozen=True)
class Notification:
    """A NOTIFY: `payload` is a queue's name or a job's id, by channel."""

    channel: str
    payload: str


class Listener:
    """A connection of its own that LISTENs; for the relay and for the API's tailer. Not shared between threads."""

    def __init__(self, url: str, channels: tuple[str, ...]) -> None:
        """Connect and listen.

        Raises:
            Unreachable: the database does not answer. Make a new one later, and look at the tables once: what was
                notified in between is not told again.
        """
        dsn = sa.make_url(url).set(drivername="postgresql").render_as_string(hide_password=False)
        try:
            self._connection = psycopg.connect(dsn, autocommit=True, connect_timeout=CONNECT_TIMEOUT)
            for channel in channels:
                self._connection.execute(sql.SQL("LISTEN {}").format(sql.Identifier(channel)))
        except psycopg.OperationalError as error:
            raise unreachable(error) from error

    def wait(self, timeout: float) -> list[Notification]:
        """The notifications that arrive within `timeout` seconds: returns at once with the first ones, [] if none.

        Raises:
            Unreachable: the connection is gone.
        """
        try:
            return [
                Notification(notify.channel, notify.payload)
                for notify in self._connection.notifies(timeout=timeout, stop_after=1)
            ]
        except psycopg.OperationalError as error:
            raise unreachable(error) from error

    def close(self) -> None:
        """Close the connection."""
        self._connection.close()

    def __enter__(self) -> Listener:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
