"""Where servers that are too old are refused: migrations, `/readyz`, `marey doctor`, the scheduler's log."""

from __future__ import annotations

import pytest
import sqlalchemy as sa

from marey.cli import doctor_servers as backing
from marey.core import versions
from marey.core.errors import Conflict
from marey.db import check_revision, upgrade
from marey.runtime.queue import check_queue
from marey.scheduler import servers


@pytest.fixture
def _demanding(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(versions, "POSTGRES", 99)
    monkeypatch.setattr(versions, "REDIS", (99, 0))


@pytest.mark.usefixtures("_demanding")
def test_everything_that_starts_or_looks_refuses_them(
    engine: sa.Engine, queue_url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for call in (lambda: upgrade(engine), lambda: check_revision(engine)):
        with pytest.raises(Conflict, match=r"PostgreSQL .* is too old: .* needs 99"):
            call()
    with pytest.raises(Conflict, match=r"Redis .* is too old"):
        check_queue(queue_url)
    for found in (backing.database(engine), backing.queue("queue", queue_url)):
        assert (found.state, "is too old" in found.message, bool(found.hint)) == ("bad", True, True)
    said: list[str] = []
    monkeypatch.setattr(servers.log, "error", lambda _event, **fields: said.append(fields["error"]))
    check = servers.server_check(engine, queue_url)
    check()
    check()
    assert [message.split()[0] for message in said] == ["PostgreSQL", "Redis"]


def test_those_of_the_tests_are_new_enough(engine: sa.Engine, queue_url: str) -> None:
    check_revision(engine)
    assert check_queue(queue_url)
    assert backing.database(engine).state == "ok"
