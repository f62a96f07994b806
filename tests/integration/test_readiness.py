"""`/readyz`: answered at once from checks that run in the background; and the details that need a key."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path

import httpx2
import pytest
import sqlalchemy as sa
from pydantic import SecretStr
from websockets.exceptions import ConnectionClosedError
from websockets.sync.client import connect

from marey.api import readiness
from marey.api.health.checks import ModelCheck
from marey.api.readiness import DependencyCheck, Readiness
from marey.core.errors import Unreachable
from marey.core.settings import Settings
from marey.db import transaction
from marey.embedded import EmbeddedServer
from marey.jobs import WorkerHeartbeat, beat
from tests.servers.ports import free_ports
from tests.support.live_api import ApiThread, settings_of, wait_until


@pytest.fixture
def hanging() -> Iterator[threading.Event]:
    """Set to let the checks go on that hang."""
    go = threading.Event()
    yield go
    go.set()


def of(**checks: DependencyCheck) -> Readiness:
    return Readiness(checks, interval=0.02)


def test_nothing_is_ready_before_its_first_round(hanging: threading.Event) -> None:
    found = of(slow=DependencyCheck(lambda: hanging.wait(30), "slow"), fast=DependencyCheck(lambda: None, "fast"))
    assert not any(result.ok for result in found.results().values())
    found.start()
    wait_until(lambda: found.results()["fast"].ok)
    assert not found.results()["slow"].ok
    hanging.set()
    wait_until(lambda: found.results()["slow"].ok)
    found.stop()


def test_a_check_that_hangs_becomes_a_failure_and_holds_up_no_other(
    hanging: threading.Event, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(readiness, "STALE_SECONDS", 0.3)
    hangs = threading.Event()
    found = of(
        odd=DependencyCheck(lambda: hanging.wait(30) if hangs.is_set() else None, "odd is down"),
        even=DependencyCheck(lambda: None, "even is down"),
    )
    found.start()
    wait_until(lambda: all(result.ok for result in found.results().values()))
    hangs.set()
    wait_until(lambda: not found.results()["odd"].ok)
    assert found.results()["odd"].message == "odd is down"
    assert found.results()["even"].ok
    hanging.set()
    wait_until(lambda: found.results()["odd"].ok)
    found.stop()


def test_a_check_with_a_bug_fails_and_goes_on() -> None:
    rounds: list[None] = []

    def buggy() -> None:
        rounds.append(None)
        raise ZeroDivisionError

    found = of(buggy=DependencyCheck(buggy, "buggy is down"))
    found.start()
    wait_until(lambda: len(rounds) > 2)
    assert not found.results()["buggy"].ok
    found.stop()


@pytest.fixture
def nowhere(module_database_url: str, valkey: EmbeddedServer, tmp_path: Path) -> tuple[Settings, list[str]]:
    """Settings whose database, queue and store are away, and words that would tell where they are."""
    config = settings_of(tmp_path, module_database_url, valkey.url)
    database, queue, store = free_ports(3)
    away = {
        "database_url": SecretStr(f"postgresql+psycopg://secretive:pw@127.0.0.1:{database}/hidden"),
        "queue_url": SecretStr(f"redis://127.0.0.1:{queue}/0"),
        "store": "s3://buried",
        "s3_endpoint": f"127.0.0.1:{store}",
        "s3_access_key": SecretStr("access"),
        "s3_secret_key": SecretStr("secret"),
    }
    words = [*map(str, (database, queue, store)), "127.0.0.1", "secretive", "hidden", "buried", "MAREY_", str(tmp_path)]
    return config.model_copy(update=away), words


def test_nobody_without_a_key_is_told_where_anything_is(nowhere: tuple[Settings, list[str]]) -> None:
    config, words = nowhere
    with ApiThread(config) as url, httpx2.Client(base_url=url, timeout=60) as http:
        shown = {"Authorization": f"Bearer marey_{'a' * 8}_{'b' * 43}"}
        answers = [
            http.get("/livez"),
            http.get("/v1/jobs", headers=shown),
            http.get("/metrics", headers=shown),
            http.post("/v1/jobs", headers=shown, json={"items": [{"prompt": "walk"}]}),
            http.post("/v1/texts/parse", headers=shown, json={"prompts": ["walk"]}),
        ]
        assert [answer.status_code for answer in answers] == [200, 503, 503, 503, 503]
        assert answers[1].json()["detail"] == "the database does not answer"
        wait_until(lambda: "database does not answer" in http.get("/readyz").text, 30)
        wait_until(lambda: "queue does not answer" in http.get("/readyz").text, 30)
        answers.append(http.get("/readyz"))
        assert answers[-1].status_code == 503
        told = "\n".join(answer.text for answer in answers)
        stream = f"ws{url.removeprefix('http')}/v1/streams/{'0' * 8}-0000-7000-8000-{'0' * 12}"
        with connect(stream, additional_headers=shown) as socket, pytest.raises(ConnectionClosedError) as closed:
            socket.recv(timeout=30)
        assert closed.value.rcvd is not None
        assert closed.value.rcvd.code == 1013
        told += f"\n{closed.value.rcvd.reason}"
        for word in words:
            assert word not in told, (word, told)


def test_an_error_says_in_the_log_what_clients_are_not_told() -> None:
    error = Unreachable("db-7:5432 refused", where="database", public="the database does not answer")
    assert "db-7:5432" in str(error)


def test_a_worker_that_generates_nothing_has_no_model(engine: sa.Engine) -> None:
    check = ModelCheck(engine)
    for queue, bundle in (("edit", "edit"), ("text", "light"), ("evaluator", "evaluator-starter@0")):
        with transaction(engine) as conn:
            beat(conn, WorkerHeartbeat(queue, queue, "host", 7, "cpu", bundle))
        with pytest.raises(Unreachable, match="no worker has its model loaded yet"):
            check()
    with transaction(engine) as conn:
        beat(conn, WorkerHeartbeat("w", "hgm3", "host", 8, "cpu", "tiny@0"))
    check()
