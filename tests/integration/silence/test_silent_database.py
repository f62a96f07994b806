"""Connections to Postgres that stay open and fall silent: every kind of call ends at its deadline."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor

import psycopg
import pytest
import sqlalchemy as sa

from marey.core.errors import Unreachable
from marey.db import EVENT_CHANNEL, Deadline, Listener, create_engine, outages, transaction
from marey.db.connections import HEARD_LATELY, SilentConnection
from marey.db.deadlines import (
    BULK,
    CONNECT_SECONDS,
    HEARTBEAT,
    KINDS,
    ORDINARY,
    PING_SECONDS,
    PROBE_EVERY,
    ROLLBACK_SECONDS,
    in_all,
)
from tests.servers.stalling_proxy import StallingProxy

QUICK = Deadline("quick", statement=0.8, idle=30.0, margin=0.4)
SLACK = 5.0
"""Seconds that a busy machine may add to a deadline."""


@pytest.fixture
def behind(proxied: str) -> Iterator[sa.Engine]:
    """An engine behind the proxy, with a short deadline."""
    engine = create_engine(proxied, deadline=QUICK)
    yield engine
    engine.dispose()


def took(action: Callable[[], object]) -> float:
    """Seconds until `action` raises Unreachable."""
    began = time.monotonic()
    with pytest.raises(Unreachable, match="does not answer"):
        action()
    return time.monotonic() - began


def test_a_statement_ends_at_its_deadline_and_the_next_transaction_works(
    behind: sa.Engine, proxy: StallingProxy
) -> None:
    def ask() -> None:
        with transaction(behind) as conn:
            conn.execute(sa.text("SELECT 1"))
            proxy.stall()
            conn.execute(sa.text("SELECT 2"))

    assert took(ask) < QUICK.answer + SLACK
    with transaction(behind) as conn:
        assert conn.execute(sa.text("SELECT 3")).scalar_one() == 3
    assert outages(behind) == 1


def test_a_commit_ends_at_its_deadline(behind: sa.Engine, proxy: StallingProxy) -> None:
    def write() -> None:
        with transaction(behind) as conn:
            conn.execute(sa.text("CREATE TABLE once (n int)"))
            proxy.stall()

    assert took(write) < QUICK.answer + SLACK


def test_a_rollback_ends_at_its_deadline(behind: sa.Engine, proxy: StallingProxy) -> None:
    def fail() -> None:
        with transaction(behind) as conn:
            conn.execute(sa.text("SELECT 1"))
            proxy.stall()
            raise ValueError

    assert took(fail) < QUICK.answer + SLACK


def test_the_rollback_of_a_returned_connection_ends_at_its_deadline(behind: sa.Engine, proxy: StallingProxy) -> None:
    connection = behind.raw_connection()
    connection.cursor().execute("SELECT 1")
    proxy.stall()
    began = time.monotonic()
    connection.close()
    assert time.monotonic() - began < QUICK.answer + SLACK
    assert behind.pool.checkedout() == 0  # pyright: ignore[reportAttributeAccessIssue] - of the queue pool


def test_a_copy_ends_at_its_deadline(behind: sa.Engine, proxy: StallingProxy) -> None:
    def copy() -> None:
        with transaction(behind) as conn:
            conn.execute(sa.text("CREATE TEMPORARY TABLE copied (word text)"))
            driver = conn.connection.driver_connection
            assert isinstance(driver, psycopg.Connection)
            with driver.cursor().copy("COPY copied FROM STDIN") as rows:
                rows.write_row(("one",))
                proxy.stall()

    assert took(copy) < QUICK.answer + SLACK


def test_a_pooled_connection_that_is_silent_is_replaced_before_use(behind: sa.Engine, proxy: StallingProxy) -> None:
    with transaction(behind):
        pass
    proxy.stall()
    began = time.monotonic()
    with transaction(behind) as conn:
        assert conn.execute(sa.text("SELECT 1")).scalar_one() == 1
    assert PING_SECONDS <= time.monotonic() - began < PING_SECONDS + SLACK


def test_connecting_ends_at_its_deadline_and_others_do_not_wait_for_it(behind: sa.Engine, proxy: StallingProxy) -> None:
    def ask() -> None:
        with transaction(behind):
            pass

    proxy.stall(new=True)
    assert took(ask) < CONNECT_SECONDS + SLACK
    # From here on one caller at a time tries the server: forty do not keep forty threads for seconds each.
    began = time.monotonic()
    with ThreadPoolExecutor(40) as pool:
        tries = [pool.submit(took, ask) for _ in range(40)]
        slow = sum(one.result() > CONNECT_SECONDS - 1 for one in tries)
    assert slow <= 3
    assert time.monotonic() - began < 2 * CONNECT_SECONDS + SLACK
    proxy.resume()
    with transaction(behind):
        pass


def test_one_missed_deadline_ends_the_calls_of_other_threads_and_drops_idle_connections(
    proxied: str, proxy: StallingProxy
) -> None:
    engine, other = create_engine(proxied), create_engine(proxied, deadline=QUICK)
    with transaction(engine), transaction(engine), transaction(engine):
        pass  # three connections, idle from now on
    started = threading.Event()

    def wait_long() -> None:
        with transaction(engine, BULK) as conn:
            conn.execute(sa.text("SELECT 1"))
            started.set()
            conn.execute(sa.text("SELECT pg_sleep(50)"))

    def ask() -> None:
        with transaction(other) as conn:
            conn.execute(sa.text("SELECT 1"))
            proxy.stall()
            time.sleep(HEARD_LATELY)
            conn.execute(sa.text("SELECT 2"))

    with ThreadPoolExecutor(1) as pool:
        long = pool.submit(took, wait_long)
        assert started.wait(10)
        took(ask)
        assert long.result() < HEARD_LATELY + QUICK.answer + SLACK
    began = time.monotonic()
    with transaction(engine) as conn:  # not one check before use waits for its deadline
        conn.execute(sa.text("SELECT 1"))
    assert time.monotonic() - began < PING_SECONDS
    engine.dispose()
    other.dispose()


def test_locks_of_a_lost_connection_are_free_as_soon_as_the_process_is_back(
    behind: sa.Engine, proxy: StallingProxy, engine: sa.Engine
) -> None:
    """Here a COPY that waits for data, which no timeout of Postgres ends."""
    with transaction(engine) as conn:
        conn.execute(sa.text("CREATE TABLE copied (word text)"))

    def copy() -> None:
        with transaction(behind) as conn:
            conn.execute(sa.text("LOCK TABLE copied"))
            driver = conn.connection.driver_connection
            assert isinstance(driver, psycopg.Connection)
            with driver.cursor().copy("COPY copied FROM STDIN") as rows:
                rows.write_row(("one",))
                proxy.stall()
                rows.write(b"two\n" * 20_000)

    took(copy)
    assert _locks(engine) > 0
    with transaction(behind):
        pass
    until = time.monotonic() + SLACK
    while _locks(engine) and time.monotonic() < until:
        time.sleep(0.05)
    assert _locks(engine) == 0


def _locks(engine: sa.Engine) -> int:
    query = "SELECT count(*) FROM pg_locks WHERE relation = 'copied'::regclass AND mode = 'AccessExclusiveLock'"
    with transaction(engine) as conn:
        return conn.execute(sa.text(query)).scalar_one()


def test_a_living_server_raises_no_alarm_and_keeps_what_it_answers(proxied: str, proxy: StallingProxy) -> None:
    """A slow statement ends by the server's limit; connections in use survive the alarm of another one."""
    engine = create_engine(proxied, deadline=QUICK)
    with pytest.raises(Unreachable, match="took too long"), transaction(engine) as conn:
        conn.execute(sa.text("SELECT pg_sleep(10)"))
    assert outages(engine) == 0
    silent = engine.raw_connection()
    proxy.stall()
    busy = create_engine(proxied)
    with transaction(busy) as conn:
        pid = conn.execute(sa.text("SELECT pg_backend_pid()")).scalar_one()
        with pytest.raises(SilentConnection):
            silent.cursor().execute("SELECT 1")
        assert conn.execute(sa.text("SELECT pg_backend_pid()")).scalar_one() == pid
    assert outages(engine) == 1
    silent.close()
    engine.dispose()
    busy.dispose()


def test_a_connection_that_lets_a_byte_through_now_and_then_is_given_up(
    behind: sa.Engine, proxy: StallingProxy, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("marey.db.connections.in_all", lambda limit: limit)

    def ask() -> None:
        with transaction(behind) as conn:
            conn.execute(sa.text("SELECT 1"))
            proxy.drip()
            conn.execute(sa.text("SELECT repeat('x', 1000)"))

    assert took(ask) < QUICK.answer + SLACK
    assert outages(behind) == 1


def test_short_calls_count_the_whole_round_trip_and_long_ones_have_more() -> None:
    for short in (PING_SECONDS, ROLLBACK_SECONDS, HEARTBEAT.answer):
        assert in_all(short) == short
    for kind in KINDS:
        assert kind is HEARTBEAT or in_all(kind.answer) > 2 * kind.answer


def test_an_answer_that_still_comes_survives_the_alarm_of_another_connection(
    proxied: str, proxy: StallingProxy
) -> None:
    """Rows that take longer than `HEARD_LATELY` in all, and never stop for as long."""
    reading, other = create_engine(proxied), create_engine(proxied, deadline=QUICK)
    silent = other.raw_connection()
    proxy.stall()
    rows = "SELECT repeat('x', 1000), pg_sleep(0.01) FROM generate_series(1, 600)"

    def read() -> int:
        with transaction(reading) as conn:
            return len(conn.execute(sa.text(rows)).all())

    with ThreadPoolExecutor(1) as pool:
        all_rows = pool.submit(read)
        time.sleep(HEARD_LATELY + 1)
        with pytest.raises(SilentConnection):
            silent.cursor().execute("SELECT 1")
        assert all_rows.result() == 600
    assert outages(other) == 1
    silent.close()
    reading.dispose()
    other.dispose()


def test_connections_that_are_reset_are_replaced_and_their_sessions_ended(
    behind: sa.Engine, proxy: StallingProxy, engine: sa.Engine
) -> None:
    """Also where psycopg reports the broken socket and leaves the connection as if it were in use."""
    pids = "SELECT count(*) FROM pg_stat_activity WHERE pid = ANY(:pids)"
    with transaction(behind) as one, transaction(behind) as two:
        lost = [conn.execute(sa.text("SELECT pg_backend_pid()")).scalar_one() for conn in (one, two)]
    proxy.reset()
    time.sleep(0.2)
    for _ in range(2):
        with transaction(behind) as one, transaction(behind) as two:
            assert [conn.execute(sa.text("SELECT 1")).scalar_one() for conn in (one, two)] == [1, 1]
    until = time.monotonic() + SLACK
    left = -1
    while left and time.monotonic() < until:
        with transaction(engine) as conn:
            left = conn.execute(sa.text(pids), {"pids": lost}).scalar_one()
        time.sleep(0.05)
    assert left == 0
    assert outages(behind) == 0


def test_an_error_of_the_socket_closes_the_connection(behind: sa.Engine, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object, **__: object) -> None:
        raise psycopg.OperationalError("connection socket closed")

    with transaction(behind):
        pass
    raw = behind.raw_connection()
    driver = raw.driver_connection
    assert isinstance(driver, psycopg.Connection)
    raw.close()
    with monkeypatch.context() as patched:
        patched.setattr("psycopg.connection.waiting.wait", broken)
        with pytest.raises(psycopg.OperationalError):
            driver.cursor().execute("SELECT 1")
    assert driver.closed
    with transaction(behind) as conn:
        assert conn.execute(sa.text("SELECT 1")).scalar_one() == 1


def test_a_process_that_was_stopped_itself_raises_no_alarm(behind: sa.Engine, monkeypatch: pytest.MonkeyPatch) -> None:
    """Time that passes here while the answer lies ready is no silence."""
    with transaction(behind) as conn:
        conn.execute(sa.text("SELECT 1"))
        jumps = iter(range(0, 1_000_000, 1000))
        monkeypatch.setattr("marey.db.connections.time.monotonic", lambda: float(next(jumps)))
        conn.execute(sa.text("SELECT 2"))
    monkeypatch.undo()
    assert outages(behind) == 0


def test_a_listener_finds_its_connection_silent(proxied: str, proxy: StallingProxy) -> None:
    with Listener(proxied, (EVENT_CHANNEL,)) as listener:
        proxy.stall()

        def listen() -> None:
            for _ in range(200):
                listener.wait(0.25)

        assert took(listen) < PROBE_EVERY + PING_SECONDS + SLACK


def test_a_probe_loses_no_notification(database_url: str, engine: sa.Engine, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("marey.db.listener.PROBE_EVERY", 0.0)
    with Listener(database_url, (EVENT_CHANNEL,)) as listener:
        for number in range(50):
            with transaction(engine) as conn:
                conn.execute(sa.text(f"SELECT pg_notify('{EVENT_CHANNEL}', '{number}')"))
            if number % 2:
                heard = {one.payload for _ in range(3) for one in listener.wait(0.05)}
                assert {str(number), str(number - 1)} <= heard


@pytest.mark.parametrize("kind", [ORDINARY, BULK])
def test_the_server_knows_the_limits_of_each_kind(engine: sa.Engine, kind: Deadline) -> None:
    with transaction(engine, kind) as conn:
        names = ("statement_timeout", "idle_in_transaction_session_timeout")
        query = "SELECT setting::int FROM pg_settings WHERE name = :name"
        limits = [conn.execute(sa.text(query), {"name": name}).scalar_one() / 1000 for name in names]
    assert limits == [kind.statement, kind.idle]
    assert kind.answer > kind.statement
    with transaction(engine, kind) as conn:
        conn.execute(sa.text("SET TRANSACTION ISOLATION LEVEL REPEATABLE READ READ ONLY"))
