"""Connections to Postgres that detect a silent server.

A firewall that drops a flow, a hung load balancer or a stopped server leave a connection open: the client's kernel may
even see every byte acknowledged, so neither keepalives nor `tcp_user_timeout` find the fault. Only a deadline on the
answer does. docs/decisions/0014-deadlines.md has the reasons.
"""

from __future__ import annotations

import contextlib
import os
import select
import socket
import threading
import time
import weakref
from collections.abc import Generator
from dataclasses import dataclass
from datetime import datetime
from typing import Any, NoReturn, TypeVar

import psycopg
import sqlalchemy as sa
import structlog
from psycopg.waiting import Ready

from marey.db.deadlines import CONNECT_SECONDS, ORDINARY, PING_SECONDS, ROLLBACK_SECONDS, Deadline, in_all

log = structlog.get_logger(__name__)

RV = TypeVar("RV")
_Waiting = Generator[Any, Any, RV]
INTERVAL = 0.1
"""Seconds between checks of the deadline of a waiting call."""
HEARD_LATELY = 2.0
"""Seconds for which a connection counts as alive after an answer. Shorter than any deadline."""
STOPPED = 1.0
"""A gap longer than this between two checks means that this process was suspended; it counts as this many seconds."""
TURN_SECONDS = 1.0
"""Seconds that a caller waits for another one that already tries a silent server."""

SET_UP = """
    SELECT pooled, clock_timestamp(), set_config('timezone', 'UTC', false),
        CASE WHEN NOT pooled THEN set_config('statement_timeout', statement, false) END,
        CASE WHEN NOT pooled THEN set_config('idle_in_transaction_session_timeout', idle, false) END
    FROM (SELECT pg_backend_pid() <> %s AS pooled, %s AS statement, %s AS idle) AS session
"""

END_SESSIONS = """
    SELECT count(pg_terminate_backend(activity.pid))
    FROM pg_stat_activity AS activity, unnest(%s::int[], %s::timestamptz[]) AS lost (pid, seen)
    WHERE activity.pid = lost.pid AND activity.backend_start <= lost.seen AND activity.usename = current_user
"""


@dataclass(frozen=True)
class ServerSession:
    """A backend process of the server; its number may be reused by one that starts later than `seen`."""

    pid: int
    seen: datetime


def milliseconds(deadline: Deadline) -> tuple[str, str]:
    """Return the server's two limits, `statement_timeout` and `idle_in_transaction_session_timeout`, as text."""
    return str(round(deadline.statement * 1000)), str(round(deadline.idle * 1000))


class SilentConnection(psycopg.OperationalError):
    """The server did not answer before the deadline; the connection is closed."""


class ConnectionGroup:
    """All connections of this process to one database: when one misses its deadline, all silent ones are closed."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._connections: weakref.WeakSet[DeadlineConnection] = weakref.WeakSet()
        self._probing = threading.Lock()
        self._lost: set[ServerSession] = set()
        self.silent = False
        """A deadline was missed, and no answer came since."""
        self.misses = 0
        """Number of times the server was found silent; a caller that compares it with an earlier value detects an
        outage."""

    def add(self, connection: DeadlineConnection) -> None:
        """Add a new connection."""
        with self._lock:
            self._connections.add(connection)

    def missed(self, seconds: float) -> None:
        """Handle a missed deadline: close every connection that has not heard from the server lately.

        Threads that wait on a closed connection are woken. Connections that are in use and hear from the server stay
        open, so a false alarm on a busy server costs idle connections and the longest statements only.
        """
        with self._lock:
            self.silent = True
            self.misses += 1
            silent = [one for one in self._connections if not (one.closed or one.heard_lately())]
            self._lost |= {one.session for one in silent if one.session is not None}
        for one in silent:
            one.shut_down()
        log.warning("database_silent", seconds=seconds, connections_closed=len(silent))

    def lose(self, session: ServerSession | None) -> None:
        """Note that a connection broke: a middlebox that cut it may not have told the server."""
        if session is not None:
            with self._lock:
                self._lost.add(session)

    def end_lost(self, connection: DeadlineConnection) -> None:
        """End the sessions of closed silent and of broken connections on the server, which may not have noticed.

        Such a session would keep its locks until a timeout of the server, a COPY that waits for data for ever (no
        timeout of Postgres applies), and its share of `max_connections` until the network gives it up.
        """
        with self._lock:
            lost, self._lost = self._lost, set[ServerSession]()
        if not lost:
            return
        values = ([one.pid for one in lost], [one.seen for one in lost])
        try:
            (ended,) = connection.execute(END_SESSIONS, values).fetchone() or (0,)
        except psycopg.Error as error:
            with self._lock:
                self._lost |= lost
            log.warning("lost_sessions_not_ended", sessions=len(lost), error=type(error).__name__)
            if connection.closed:
                raise
        else:
            if ended:
                log.info("lost_sessions_ended", sessions=ended)

    def answered(self) -> None:
        """Record that the server answered."""
        self.silent = False

    @contextlib.contextmanager
    def turn(self) -> Generator[None]:
        """Guard the checkout of a connection: while the server is silent, one caller at a time tries it.

        The others fail at once, and occupy neither threads nor pool slots.

        Raises:
            SilentConnection: another caller tries already, and has not succeeded within `TURN_SECONDS`.
        """
        if not self.silent:
            yield
            return
        if not self._probing.acquire(timeout=TURN_SECONDS):
            raise SilentConnection("the server is silent; another call tries whether it answers again")
        if not self.silent:
            self._probing.release()
            yield
            return
        try:
            yield
        finally:
            self._probing.release()


class DeadlineConnection(psycopg.Connection[tuple[Any, ...]]):
    """A psycopg connection on which every round trip is limited to `limit` seconds of silence.

    Every round trip of psycopg (statement, COPY, commit, rollback) goes through `wait`; connecting has a timeout of
    its own. A missed deadline closes the connection and notifies its group.
    """

    group: ConnectionGroup
    limit: float = PING_SECONDS
    """Seconds of silence after which a call fails."""
    deadline: Deadline = ORDINARY
    """Limits that the server's session was set up with."""
    session: ServerSession | None = None
    """Session on the server; None if a pooler hides it."""
    pooled: bool = False
    """True behind a pooler (PgBouncer): the session's state is shared."""
    _heard: float = 0.0
    _line: socket.socket | None = None
    _line_lock: threading.Lock

    def join(self, group: ConnectionGroup) -> None:
        """Join `group`, right after connecting."""
        self.group = group
        self._heard = time.monotonic()
        self._line_lock = threading.Lock()
        # Duplicated descriptor: libpq may close its own at any time, and the number may be reused.
        self._line = socket.socket(fileno=os.dup(self.pgconn.socket))
        group.add(self)

    def set_up(self, deadline: Deadline) -> None:
        """Set the limits of the session, and learn whether a pooler stands between.

        A pooler answers a connection with a process number of its own. In transaction mode it may run each
        transaction in another session, so session state (limits, prepared statements) is not used there:
        `transaction` sets the limits of each transaction. The time zone is the exception: poolers keep it for each
        client.
        """
        self.deadline = deadline
        values = (self.pgconn.backend_pid, *milliseconds(deadline))
        row = self.execute(SET_UP, values).fetchone()
        assert row is not None
        self.pooled, now, *_ = row
        if self.pooled:
            self.prepare_threshold = None
        else:
            self.session = ServerSession(self.pgconn.backend_pid, now)

    def heard_lately(self) -> bool:
        """Return True if the server answered on this connection within the last `HEARD_LATELY` seconds."""
        return time.monotonic() - self._heard < HEARD_LATELY

    def shut_down(self) -> None:
        """End the connection from any thread: a call that waits on it fails at once."""
        with self._line_lock:
            if self._line is not None:
                with contextlib.suppress(OSError):
                    self._line.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        """Close the connection; never waits for the server."""
        if self._line is not None and (self.broken or self._is_cut(self._line)):
            self.group.lose(self.session)
        super().close()
        if self._line is not None:
            with self._line_lock:
                self._line.close()
                self._line = None

    def rollback(self) -> None:
        """Roll back, within `ROLLBACK_SECONDS`."""
        limit = self.limit
        self.limit = min(limit, ROLLBACK_SECONDS)
        try:
            super().rollback()
        finally:
            self.limit = limit

    def wait(self, gen: _Waiting[RV], interval: float = INTERVAL, timeout: float | None = None) -> RV:
        """Drive a round trip until it is done.

        Raises:
            SilentConnection: no data for `limit` seconds, or data arrived too slowly (`in_all`). Not with a
                `timeout`, which the caller sets to wait for notifications.
        """
        if timeout is not None:
            return super().wait(gen, interval, timeout)
        try:
            return super().wait(self._watched(gen), interval)
        except psycopg.OperationalError as error:
            if error.sqlstate is None and not self.closed:
                # psycopg leaves the connection "active" when poll finds the socket broken. It is unusable, but
                # SQLAlchemy treats an error of its pre-use check as a lost connection only if it is closed.
                self.close()
            raise

    def _watched(self, gen: _Waiting[RV]) -> Generator[Any, Any, RV]:
        """Run `gen`, but give up after `limit` seconds of silence, or after `in_all` of them in total."""
        limit_in_all = in_all(self.limit)
        spent = 0.0
        try:
            wanted = next(gen)
            looked = moved = time.monotonic()
            while True:
                ready = yield wanted
                now = time.monotonic()
                spent += min(now - looked, STOPPED)
                looked = now
                if ready:
                    moved = now
                    if ready & Ready.R:
                        self._heard = now
                elif now - moved >= self.limit and not self._has_data():
                    self._give_up(self.limit)
                wanted = gen.send(ready)
                if spent >= limit_in_all:
                    self._give_up(limit_in_all)
        except StopIteration as end:
            self._heard = time.monotonic()
            return end.value

    def _has_data(self) -> bool:
        """Return True if the answer is here after all: this process, not the server, may have been suspended."""
        poll = select.poll()
        poll.register(self.pgconn.socket, select.POLLIN)
        return bool(poll.poll(0))

    @staticmethod
    def _is_cut(line: socket.socket) -> bool:
        """Return True if the connection was reset, or the other side has closed it."""
        poll = select.poll()
        poll.register(line, getattr(select, "POLLRDHUP", 0))  # only Linux reports a half-closed one
        return bool(poll.poll(0))

    def _give_up(self, seconds: float) -> NoReturn:
        self._heard = -HEARD_LATELY
        self.group.missed(seconds)
        self.close()
        raise SilentConnection(f"no whole answer for {seconds:g} seconds; the connection is closed")


_groups: weakref.WeakValueDictionary[str, ConnectionGroup] = weakref.WeakValueDictionary()
_groups_lock = threading.Lock()


def group_of(url: sa.URL) -> ConnectionGroup:
    """Return the group of this process' connections to a database."""
    key = url.set(drivername="postgresql").render_as_string(hide_password=False)
    with _groups_lock:
        group = _groups.get(key)
        if group is None:
            group = _groups[key] = ConnectionGroup()
        return group


def open_connection(group: ConnectionGroup, deadline: Deadline, *arguments: Any, **options: Any) -> DeadlineConnection:
    """Connect, and set the session up for `deadline` in one more round trip. Arguments as of `psycopg.connect`.

    Raises:
        psycopg.OperationalError: the server cannot be reached, or did not answer in time.
    """
    try:
        connection = DeadlineConnection.connect(*arguments, **{**options, "connect_timeout": CONNECT_SECONDS})
    except psycopg.errors.ConnectionTimeout:
        group.missed(CONNECT_SECONDS)
        raise
    try:
        connection.join(group)
        autocommit, connection.autocommit = connection.autocommit, True
        connection.set_up(deadline)
        group.end_lost(connection)
        connection.autocommit = autocommit
    except BaseException:
        connection.close()
        raise
    group.answered()
    return connection
