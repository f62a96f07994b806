"""Waiting for NOTIFY."""

from __future__ import annotations

import contextlib
import time
from dataclasses import dataclass
from uuid import uuid4

import psycopg
import sqlalchemy as sa
from psycopg import sql

from marey.core.errors import InvalidInput, Unreachable
from marey.db.connections import DeadlineConnection, group_of, open_connection
from marey.db.database import unreachable
from marey.db.deadlines import ORDINARY, PING_SECONDS, PROBE_EVERY


@dataclass(frozen=True)
class Notification:
    """A NOTIFY: `payload` is a queue's name or a job's id, by channel."""

    channel: str
    payload: str


def check_listening(url: str) -> None:
    """Connect once as a `Listener` does, for a server that starts. An unreachable database is not an error here.

    Raises:
        InvalidInput: notifications do not arrive.
    """
    with contextlib.suppress(Unreachable), Listener(url, ()):
        pass


class Listener:
    """A dedicated LISTEN connection, for the relay and for the API's broadcaster. Not thread-safe."""

    def __init__(self, url: str, channels: tuple[str, ...]) -> None:
        """Connect and listen.

        Raises:
            Unreachable: the database does not answer. Reconnect later, and read the tables once: notifications in
                between are lost.
            InvalidInput: a transaction pooler in between, which does not forward notifications.
        """
        self._received: list[Notification] = []
        try:
            self._connection = _connect(url)
            try:
                self._listen(channels)
                if self._connection.pooled:
                    self._check_delivery(url)
            except BaseException:
                self.close()
                raise
        except psycopg.OperationalError as error:
            raise unreachable(error) from error
        self._heard = time.monotonic()

    def wait(self, timeout: float) -> list[Notification]:
        """Return the notifications that arrive within `timeout` seconds: at once with the first ones, [] if none.

        After `PROBE_EVERY` seconds without any, the connection itself is probed.

        Raises:
            Unreachable: the connection is gone, or silent.
        """
        try:
            if time.monotonic() - self._heard >= PROBE_EVERY:
                self._connection.execute("SELECT 1")
                self._heard = time.monotonic()
            found, self._received = self._received, []
            found += self._receive(0.0 if found else timeout)
        except psycopg.OperationalError as error:
            raise unreachable(error) from error
        if found:
            self._heard = time.monotonic()
        return found

    def close(self) -> None:
        """Close the connection."""
        self._connection.close()

    def __enter__(self) -> Listener:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _listen(self, channels: tuple[str, ...]) -> None:
        for channel in channels:
            self._connection.execute(sql.SQL("LISTEN {}").format(sql.Identifier(channel)))

    def _receive(self, timeout: float) -> list[Notification]:
        found = self._connection.notifies(timeout=timeout, stop_after=1)
        return [Notification(notify.channel, notify.payload) for notify in found]

    def _check_delivery(self, url: str) -> None:
        """Notify this connection from another one, and check that the notification arrives.

        Raises:
            InvalidInput: it does not arrive.
        """
        channel = f"marey_check_{uuid4().hex}"
        self._listen((channel,))
        with _connect(url) as other:  # notifications of the same session would arrive in any case
            other.execute("SELECT pg_notify(%s, '')", (channel,))
        until = time.monotonic() + PING_SECONDS
        while (left := until - time.monotonic()) > 0:
            found = self._receive(left)
            self._received += [one for one in found if one.channel != channel]
            if any(one.channel == channel for one in found):
                self._connection.execute(sql.SQL("UNLISTEN {}").format(sql.Identifier(channel)))
                return
        raise InvalidInput(
            "the database address belongs to a transaction pooler, which does not forward notifications (LISTEN)",
            where="MAREY_LISTEN_URL",
            hint="Set it to the address of Postgres itself, or of a pool in session mode (docs/how-to/deployment.md).",
        )


def _connect(url: str) -> DeadlineConnection:
    parsed = sa.make_url(url).set(drivername="postgresql")
    dsn = parsed.render_as_string(hide_password=False)
    return open_connection(group_of(parsed), ORDINARY, dsn, autocommit=True, application_name="marey")
