"""Outages of the database are told as such, and pass."""

from __future__ import annotations

import threading
from pathlib import Path

import pytest
import sqlalchemy as sa

from marey.core.errors import Unreachable
from marey.db import Listener, create_engine, transaction, upgrade
from marey.db.database import EVENT_CHANNEL
from marey.db.deadlines import ORDINARY
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
