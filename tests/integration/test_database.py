"""Outages of the database are told as such, and pass."""

from __future__ import annotations

import threading
from pathlib import Path

import pytest
import sqlalchemy as sa

from marey.core.errors import InvalidInput, Unreachable
from marey.db import Listener, Notification, create_engine, transaction, upgrade
from marey.db.connections import DeadlineConnection, group_of
from marey.db.database import EVENT_CHANNEL
from marey.db.deadlines import KINDS, ORDINARY, PING_SECONDS, Deadline
from marey.db.listener import _connect  # pyright: ignore[reportPrivateUsage]
from marey.embedded import start_postgres
from marey.jobs import get_job, sweep
from tests.servers.audit import audit
from tests.servers.jobs import claim_some, commit_all, parse_texts, submit_items


def test_a_restart_of_postgres_costs_an_error_and_nothing_else(short_home: Path) -> None:
    server = start_postgres(short_home, durable=False)
    engine = create_engine(server.url)
    upgrade(engine)
    job = submit_items(engine, 4)
    parse_texts(engine)
    claimed = claim_some(engine)
    commit_all(engine, claimed, [claimed.items[0].id])
    with pytest.raises(Unreachable, match="does not answer"), transaction(engine) as conn:  # noqa: PT012
        conn.execute(sa.text("UPDATE item SET prompt = 'half done'"))
        server.kill()
        conn.execute(sa.text("SELECT 1"))
    with pytest.raises(Unreachable, match="MAREY_DATABASE_URL"):
        sweep(engine)
    with start_postgres(short_home, durable=False):
        assert len(commit_all(engine, claimed, [item.id for item in claimed.items[1:]])) == 3
        with transaction(engine) as conn:
            assert get_job(conn, "default", job).succeeded == 4
            assert conn.execute(sa.text("SELECT count(*) FROM item WHERE prompt = 'half done'")).scalar_one() == 0
            assert audit(conn) == []
        engine.dispose()


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_a_transaction_waits_for_answers_as_long_as_its_kind_says(engine: sa.Engine, kind: Deadline) -> None:
    with transaction(engine, kind) as conn:
        driver = conn.connection.driver_connection
        assert isinstance(driver, DeadlineConnection)
        assert driver.limit == kind.answer
        assert driver.heard_lately()
        row = conn.execute(sa.text("SELECT current_setting('statement_timeout')::interval")).scalar_one()
        assert row.total_seconds() == kind.statement
    with transaction(engine) as conn:
        driver = conn.connection.driver_connection
        assert isinstance(driver, DeadlineConnection)
        assert driver.limit == ORDINARY.answer
    assert driver.limit == PING_SECONDS, "the check before its next use is short"


def test_the_session_of_a_connection_that_broke_is_known_as_lost(engine: sa.Engine) -> None:
    def use_a_cut_one() -> None:
        with transaction(engine) as conn:
            driver = conn.connection.driver_connection
            assert isinstance(driver, DeadlineConnection)
            drivers.append(driver)
            with transaction(engine) as other:
                other.execute(sa.text("SELECT pg_terminate_backend(:pid, 5000)"), {"pid": driver.info.backend_pid})
            conn.execute(sa.text("SELECT 1"))

    drivers: list[DeadlineConnection] = []
    with pytest.raises(Unreachable):
        use_a_cut_one()
    assert drivers[0].closed
    assert drivers[0].session in group_of(engine.url)._lost
    with transaction(engine) as conn:
        assert conn.execute(sa.text("SELECT 1")).scalar_one() == 1


def test_a_connection_is_ended_by_another_thread_while_a_call_waits_on_it(engine: sa.Engine) -> None:
    def wait() -> None:
        with transaction(engine) as conn:
            driver = conn.connection.driver_connection
            assert isinstance(driver, DeadlineConnection)
            drivers.append(driver)
            timer = threading.Timer(0.05, driver.shut_down)
            timer.start()
            try:
                conn.execute(sa.text("SELECT pg_sleep(3)"))
            finally:
                timer.join()

    drivers: list[DeadlineConnection] = []
    with pytest.raises(Unreachable):
        wait()
    assert drivers[0].closed
    drivers[0].shut_down()  # nothing more to end


def test_an_error_of_a_statement_does_not_repeat_its_parameters(engine: sa.Engine) -> None:
    """It is logged, and they hold prompts."""
    with pytest.raises(sa.exc.DBAPIError, match="division by zero") as told, transaction(engine) as conn:
        conn.execute(sa.text("SELECT 1 / :none, :prompt"), {"none": 0, "prompt": "a person walks to zanzibar"})
    assert "zanzibar" not in str(told.value)


def test_a_database_without_room_says_so_and_names_no_file_of_its_own(engine: sa.Engine) -> None:
    full = "DO $$ BEGIN RAISE disk_full USING MESSAGE = 'could not extend file \"base/5/1\"'; END $$"
    with pytest.raises(Unreachable, match="no disk space left") as told, transaction(engine) as conn:
        conn.execute(sa.text(full))
    assert "base/5" not in str(told.value)
    assert "Free disk space" in str(told.value)


def test_a_listener_is_told_that_its_connection_is_gone(short_home: Path) -> None:
    server = start_postgres(short_home, durable=False)
    with Listener(server.url, (EVENT_CHANNEL,)) as listener:
        timer = threading.Timer(0.2, server.kill)
        timer.start()
        with pytest.raises(Unreachable):
            listener.wait(30)
        timer.join()
    with pytest.raises(Unreachable):
        Listener(server.url, (EVENT_CHANNEL,))


def test_a_listener_behind_a_pooler_checks_that_notifications_arrive_and_loses_none(
    database_url: str, engine: sa.Engine, monkeypatch: pytest.MonkeyPatch
) -> None:
    def connect(url: str) -> DeadlineConnection:
        connection = _connect(url)
        connection.pooled = True
        return connection

    def notify(channel: str) -> None:
        with transaction(engine) as conn:
            conn.execute(sa.text("SELECT pg_notify(:channel, '7')"), {"channel": channel})

    monkeypatch.setattr("marey.db.listener._connect", connect)
    checked: list[str] = []
    check = Listener._check_delivery  # pyright: ignore[reportPrivateUsage]

    def check_late(listener: Listener, url: str) -> None:
        notify(EVENT_CHANNEL)  # comes between LISTEN and the check
        checked.append(url)
        check(listener, url)

    monkeypatch.setattr(Listener, "_check_delivery", check_late)
    with Listener(database_url, (EVENT_CHANNEL,)) as listener:
        assert checked == [database_url]
        assert listener.wait(5) == [Notification(EVENT_CHANNEL, "7")]
        assert listener.wait(0.1) == []


def test_a_listener_without_notifications_is_refused_and_holds_no_connection(
    database_url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[DeadlineConnection] = []

    def connect(url: str) -> DeadlineConnection:
        made.append(_connect(url))
        made[-1].pooled = True
        return made[-1]

    monkeypatch.setattr("marey.db.listener._connect", connect)
    monkeypatch.setattr("marey.db.listener.PING_SECONDS", 0.2)
    monkeypatch.setattr(Listener, "_receive", lambda _self, _timeout: [])  # pyright: ignore[reportUnknownLambdaType]
    with pytest.raises(InvalidInput, match="transaction pooler") as refused:
        Listener(database_url, (EVENT_CHANNEL,))
    assert refused.value.where == "MAREY_LISTEN_URL"
    assert [connection.closed for connection in made] == [True, True]


def test_a_client_that_stops_in_the_middle_does_not_hold_a_job_for_ever(engine: sa.Engine) -> None:
    with transaction(engine) as conn:
        limits = [
            conn.execute(sa.text(f"SHOW {name}")).scalar_one()
            for name in ("statement_timeout", "idle_in_transaction_session_timeout", "timezone")
        ]
    assert limits == [f"{ORDINARY.statement:g}s", f"{ORDINARY.idle:g}s", "UTC"]


def test_an_address_that_nobody_answers_is_unreachable_within_seconds() -> None:
    engine = create_engine("postgresql://marey@127.0.0.1:1/marey")
    with pytest.raises(Unreachable), transaction(engine):
        pass
