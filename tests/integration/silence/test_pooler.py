"""Behind a pooler: transactions work in every mode, and a LISTEN that cannot work is refused."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
import sqlalchemy as sa

from marey.core.errors import InvalidInput
from marey.db import EVENT_CHANNEL, Listener, check_listening, create_engine, transaction, upgrade
from marey.db.deadlines import BULK, ORDINARY
from marey.jobs import get_job
from tests.servers.audit import audit
from tests.servers.jobs import claim_some, commit_all, parse_texts, submit_items
from tests.servers.pooler import PROGRAM, pooler

pytestmark = pytest.mark.skipif(PROGRAM is None, reason="PgBouncer is not installed")


@pytest.fixture
def pooled(short_home: Path, database_url: str) -> Iterator[str]:
    """The test's database behind a pooler in transaction mode."""
    with pooler(short_home, database_url, "transaction", size=2) as url:
        yield url


def test_jobs_run_behind_a_transaction_pooler(pooled: str) -> None:
    engine = create_engine(pooled)
    upgrade(engine)  # nothing to do, under its lock
    job = submit_items(engine, 40)
    parse_texts(engine)
    with ThreadPoolExecutor(8) as pool:  # more clients than sessions: none keeps a session
        for _ in range(3):
            list(pool.map(lambda _: _count(engine), range(40)))
    commit_all(engine, claim_some(engine, limit=40))
    with transaction(engine) as conn:
        assert get_job(conn, "default", job).succeeded == 40
        assert audit(conn) == []
    engine.dispose()


def _count(engine: sa.Engine) -> None:
    with transaction(engine) as conn:
        for _ in range(7):  # often enough for a statement to be prepared, where that is on
            conn.execute(sa.text("SELECT count(*) FROM item WHERE seed > :seed"), {"seed": 3})


def test_limits_hold_in_each_transaction_and_in_no_session(pooled: str, engine: sa.Engine) -> None:
    behind = create_engine(pooled)
    for kind in (ORDINARY, BULK, ORDINARY):
        with transaction(behind, kind) as conn:
            limit = conn.execute(sa.text("SELECT setting FROM pg_settings WHERE name = 'statement_timeout'"))
            assert int(limit.scalar_one()) == kind.statement * 1000
            assert conn.execute(sa.text("SHOW timezone")).scalar_one() == "UTC"
    with behind.connect() as conn:  # a session that others use, too, keeps its own
        assert conn.execute(sa.text("SHOW statement_timeout")).scalar_one() == "0"
    behind.dispose()


def test_listening_through_a_transaction_pooler_is_refused(pooled: str) -> None:
    with pytest.raises(InvalidInput, match="transaction pooler") as refused:
        Listener(pooled, (EVENT_CHANNEL,))
    assert refused.value.where == "MAREY_LISTEN_URL"
    with pytest.raises(InvalidInput, match="transaction pooler"):
        check_listening(pooled)


def test_api_and_scheduler_refuse_to_start_behind_a_transaction_pooler(
    pooled: str, queue_url: str, short_home: Path
) -> None:
    environment = {**os.environ, "MAREY_DATABASE_URL": pooled, "MAREY_QUEUE_URL": queue_url}
    for command in ("api", "scheduler"):
        ended = subprocess.run(
            [sys.executable, "-m", "marey.cli", command],
            env={**environment, "MAREY_HOME": str(short_home / "home")},
            capture_output=True,
            text=True,
            check=False,
            timeout=120,
        )
        assert ended.returncode == InvalidInput.exit_code
        assert "MAREY_LISTEN_URL" in ended.stderr


def test_listening_through_a_session_pooler_works(short_home: Path, database_url: str, engine: sa.Engine) -> None:
    with pooler(short_home, database_url, "session") as url, Listener(url, (EVENT_CHANNEL,)) as listener:
        with transaction(engine) as conn:
            conn.execute(sa.text(f"SELECT pg_notify('{EVENT_CHANNEL}', 'one')"))
        assert [one.payload for one in listener.wait(10.0)] == ["one"]
        check_listening(url)


def test_a_check_of_an_address_that_nobody_answers_is_left_to_later() -> None:
    check_listening("postgresql://marey@127.0.0.1:1/marey")
