"""The connections of a process to one database, without one."""

from __future__ import annotations

import re
from datetime import UTC, datetime
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import psycopg
import pytest
from sqlalchemy.pool import QueuePool

from marey.db import create_engine
from marey.db.connections import ConnectionGroup, DeadlineConnection, ServerSession


def connection(*, closed: bool) -> DeadlineConnection:
    """A connection whose statements fail; it may be closed by that."""

    def execute(*_: object) -> None:
        raise psycopg.OperationalError("the connection is gone")

    return cast("DeadlineConnection", SimpleNamespace(execute=execute, closed=closed))


def test_a_server_counts_as_answering_until_a_deadline_is_missed() -> None:
    group = ConnectionGroup()
    assert not group.silent
    group.missed(3.0)
    assert group.silent


def test_sessions_that_cannot_be_ended_stay_lost_and_a_broken_connection_is_told() -> None:
    group = ConnectionGroup()
    session = ServerSession(7, datetime(2026, 1, 1, tzinfo=UTC))
    group.lose(session)
    group.end_lost(connection(closed=False))
    assert group._lost == {session}
    with pytest.raises(psycopg.OperationalError, match="gone"):
        group.end_lost(connection(closed=True))
    assert group._lost == {session}


def test_a_process_holds_no_more_connections_than_the_guide_says() -> None:
    """`max_connections` is set by it; a scheduler's engine has the sizes that are assumed."""
    guide = Path(__file__).resolve().parents[3] / "docs" / "how-to" / "deployment.md"
    told = re.search(r"up to (\d+) of a scheduler", guide.read_text(encoding="utf-8"))
    assert told is not None
    pool = create_engine("postgresql://nobody@/nowhere").pool
    assert isinstance(pool, QueuePool)
    assert pool.size() + pool._max_overflow == int(told[1])
