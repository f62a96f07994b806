"""The typed client against prepared answers: one idempotency key, typed errors, listings, progress."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from marey.client import (
    Client,
    InvalidInput,
    InvalidItems,
    Item,
    ItemsFailed,
    Progress,
    QuotaUsedUp,
    TimedOut,
    Unauthenticated,
    retries,
)
from tests.support.scripted import Script, Scripted, problem, scripted_servers

NONE = {"ready": 0, "leased": 0, "succeeded": 0, "failed": 0, "dead": 0, "cancelled": 0}


@pytest.fixture
def scripted(monkeypatch: pytest.MonkeyPatch) -> Iterator[Scripted]:
    monkeypatch.setattr(retries, "FIRST_PAUSE", 0.001)
    with scripted_servers() as start:
        yield start


def client_of(scripted: Scripted, *answers: tuple[int, object]) -> tuple[Client, Script]:
    made, script = scripted(*answers)
    return Client(made.server), script


def job(state: str = "queued", **counters: int) -> dict[str, object]:
    counted = {**NONE, **counters}
    return {"id": "j", "name": None, "state": state, "total": sum(counted.values()), "counters": counted}


def test_all_attempts_of_a_submit_have_one_key_and_one_body(scripted: Scripted) -> None:
    client, script = client_of(scripted, (0, None), (503, problem("unreachable")), (202, job(ready=3)))
    rows = ["a person walks", {"prompt": "a person waves", "seed": 4}, Item("a person bows", tags=("x",))]
    with client:
        made = client.jobs.submit(rows, seed=7, tags=["all"])
    assert (made.id, made.counters.ready) == ("j", 3)
    assert len({(key, body) for _, key, body in script.asked}) == 1
    assert len(script.asked) == 3
    assert [json.loads(line) for line in script.asked[0][2].splitlines()] == [
        {"prompt": "a person walks", "seed": 7, "variants": 1, "tags": ["all"]},
        {"prompt": "a person waves", "seed": 4, "variants": 1, "tags": ["all"]},
        {"prompt": "a person bows", "seed": 7, "variants": 1, "tags": ["x", "all"]},
    ]


def test_a_key_of_the_caller_is_sent(scripted: Scripted) -> None:
    client, script = client_of(scripted, (202, job()))
    client.jobs.submit(["a person walks"], idempotency_key="monday")
    assert [key for _, key, _ in script.asked] == ["monday"]


def test_rows_with_mistakes_are_not_sent(scripted: Scripted) -> None:
    client, script = client_of(scripted)
    with pytest.raises(InvalidItems) as told:
        client.jobs.submit(["a person walks", {"prompt": "", "speed": 2}, {"prompt": "a person runs", "seed": -1}])
    assert [(problem.line, problem.field) for problem in told.value.problems] == [
        (2, "speed"), (2, "prompt"), (3, "seed"),
    ]  # fmt: skip
    assert not script.asked


def test_problems_of_the_server_name_the_lines_of_the_file(scripted: Scripted, tmp_path: Path) -> None:
    found = [{"line": 1, "field": "seconds", "message": "is too long"}]
    client, _ = client_of(scripted, (422, problem("invalid-items", problems=found, total=1)))
    (tmp_path / "a.csv").write_text("prompt,seconds\n\na person walks,9\n")
    with pytest.raises(InvalidItems) as told:
        client.jobs.submit_file(tmp_path / "a.csv")
    assert [problem.line for problem in told.value.problems] == [3]


def test_a_default_that_cannot_be_is_named_as_the_argument(scripted: Scripted) -> None:
    client, _ = client_of(scripted)
    with pytest.raises(InvalidInput) as told:
        client.jobs.submit(["a person walks"], seconds=-1)
    assert told.value.where == "seconds"


def test_a_quota_that_is_used_up_has_its_numbers(scripted: Scripted) -> None:
    quota = {"name": "queued", "limit": 10, "used": 8, "left": 2, "asked": 3}
    client, script = client_of(scripted, (429, problem("quota", quota=quota)))
    with pytest.raises(QuotaUsedUp) as told:
        client.jobs.submit(["a person walks"])
    assert (told.value.quota, told.value.limit, told.value.left, told.value.asked) == ("queued", 10, 2, 3)
    assert len(script.asked) == 1


def test_a_listing_asks_for_pages_as_it_goes(scripted: Scripted) -> None:
    pages = [{"items": [job(), job()], "next": "x"}, {"items": [job()], "next": None}]
    client, script = client_of(scripted, *((200, page) for page in pages))
    found = client.jobs.list()
    assert [next(found).id, next(found).id] == ["j", "j"]
    assert len(script.asked) == 1
    assert len(list(found)) == 1
    assert len(script.asked) == 2


def test_a_limit_ends_a_listing_without_another_page(scripted: Scripted) -> None:
    client, script = client_of(scripted, (200, {"items": [job(), job()], "next": "x"}))
    assert len(list(client.jobs.list(limit=2))) == 2
    assert len(script.asked) == 1


def test_waiting_tells_progress_and_fails_where_items_have_no_result(scripted: Scripted) -> None:
    ended = job("partial", succeeded=2, failed=1)
    client, _ = client_of(scripted, (200, job("running", leased=3)), (204, None), (200, ended), (200, ended))
    seen: list[Progress] = []
    with pytest.raises(ItemsFailed, match="1 failed, 0 dead, 0 cancelled of 3 items"):
        client.jobs.wait("j", on_progress=seen.append)
    assert [(now.state, now.done, now.total) for now in seen] == [("running", 0, 3), ("partial", 3, 3)]
    assert client.jobs.wait("j", check=False).state == "partial"


def test_waiting_ends_with_its_timeout(scripted: Scripted) -> None:
    client, _ = client_of(scripted, (200, job("running", leased=1)))
    with pytest.raises(TimedOut, match="the job goes on"):
        client.jobs.wait("j", timeout=0)


def test_a_server_without_a_key_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("MAREY_KEY", raising=False)
    monkeypatch.delenv("MAREY_KEY_FILE", raising=False)
    with pytest.raises(Unauthenticated):
        Client("http://127.0.0.1:9")
    with Client("http://127.0.0.1:9/", "key") as client:
        assert client.server.url == "http://127.0.0.1:9"


def test_an_id_stays_one_part_of_the_path(scripted: Scripted) -> None:
    client, script = client_of(scripted)
    for wrong in ("", ".", ".."):
        with pytest.raises(InvalidInput, match="is no id"):
            client.jobs.delete(wrong)
    assert not script.asked
