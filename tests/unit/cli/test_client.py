"""The client against a server that fails on purpose."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from marey.client import retries
from marey.client.server_address import Server
from marey.client.transport import Transport
from marey.core.errors import Busy, Conflict, InvalidInput, NotFound, Overloaded, Refused, Unreachable
from marey.items.problems import InvalidItems
from tests.support.scripted import Scripted, problem, scripted_servers


@pytest.fixture
def scripted(monkeypatch: pytest.MonkeyPatch) -> Iterator[Scripted]:
    monkeypatch.setattr(retries, "FIRST_PAUSE", 0.001)
    with scripted_servers() as start:
        yield start


def test_a_submit_whose_answer_is_lost_is_sent_again_with_the_same_key(
    scripted: Scripted,
) -> None:
    client, script = scripted((0, None), (503, problem("unreachable")), (202, {"id": "j"}))
    with client:
        assert client.submit([{"prompt": "a person walks"}])["id"] == "j"
        assert len(script.asked) == 3
        assert len(set(script.asked)) == 1
        assert script.asked[0][1]
        script.answers.append((202, b"{}"))
        client.submit([{"prompt": "a person walks"}])
        assert script.asked[-1][1] != script.asked[0][1]


def test_a_server_that_stays_away_is_unreachable_after_five_attempts(
    scripted: Scripted,
) -> None:
    client, script = scripted(*[(503, problem("unreachable"))] * 9)
    with client, pytest.raises(Unreachable):
        client.get("/v1/jobs")
    assert len(script.asked) == retries.ATTEMPTS


@pytest.mark.parametrize(
    ("code", "kind", "error", "exit_code"),
    [
        (404, "not-found", NotFound, 3),
        (409, "conflict", Conflict, 2),
        (403, "refused", Refused, 5),
        (422, "invalid-input", InvalidInput, 2),
        (422, "idempotency-mismatch", InvalidInput, 2),
    ],
)
def test_a_problem_becomes_the_error_it_was(
    scripted: Scripted, code: int, kind: str, error: type, exit_code: int
) -> None:
    client, script = scripted((code, problem(kind, where="job x", hint="Look.")))
    with client, pytest.raises(error, match=r"job x: no\n  Look\.") as caught:
        client.get("/v1/jobs/x")
    assert caught.value.exit_code == exit_code
    assert len(script.asked) == 1


def test_the_problems_of_lines_come_back_as_they_were(scripted: Scripted) -> None:
    listed = [{"line": 7, "field": "seed", "message": "is low"}]
    client, _ = scripted((422, problem("invalid-items", problems=listed, total=3)))
    with client, pytest.raises(InvalidItems, match=r"3 problems.*\n  line 7: seed: is low\n  … and 2 more"):
        client.submit([{"prompt": "a person walks"}])


def test_an_answer_of_something_else_is_told_as_such(scripted: Scripted) -> None:
    client, _ = scripted((404, "<html>"))
    with client, pytest.raises(InvalidInput, match="MAREY_SERVER"):
        client.get("/v1/jobs")


def test_what_must_not_be_done_twice_is_sent_once(scripted: Scripted) -> None:
    for answer in ((0, None), (503, problem("unreachable")), (429, problem("busy"))):
        client, script = scripted(answer, (201, {"id": "s"}))
        with client, pytest.raises(Unreachable if answer[0] != 429 else Busy):
            client.post_once("/v1/streams", {"prompt": "a person walks"})
        assert len(script.asked) == 1


def test_a_quota_that_is_used_up_is_5(scripted: Scripted, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(retries, "ATTEMPTS", 1)
    monkeypatch.setattr(retries, "BUSY_SECONDS", 0.0)
    client, _ = scripted((429, problem("busy", hint="Stop one.")))
    with client, pytest.raises(Busy, match=r"no\n  Stop one\.") as caught:
        client.get("/v1/jobs")
    assert caught.value.exit_code == 5


def test_a_server_that_is_busy_is_waited_for_longer_than_one_that_is_broken(
    scripted: Scripted, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(retries, "LONGEST_PAUSE", 0.001)
    busy = (503, problem("overloaded"))
    client, script = scripted(*[busy] * 12, (200, {"id": "job"}))
    with client:
        assert client.submit([{"prompt": "walk"}]) == {"id": "job"}
    assert len({key for _, key, _ in script.asked}) == 1, "one idempotency key for all attempts"
    assert len(script.asked) == 13
    client, script = scripted(*[(503, problem("unreachable"))] * 12)
    with client, pytest.raises(Unreachable):
        client.submit([{"prompt": "walk"}])
    assert len(script.asked) == retries.ATTEMPTS


def test_a_server_that_stays_busy_is_given_up(scripted: Scripted, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(retries, "BUSY_SECONDS", 0.001)
    client, script = scripted(*[(503, problem("overloaded"))] * 12)
    with client, pytest.raises(Overloaded) as refused:
        client.get("/v1/jobs")
    assert refused.value.exit_code == 4
    assert len(script.asked) == retries.ATTEMPTS


def test_text_that_no_request_can_hold_is_refused_with_what_to_do(scripted: Scripted) -> None:
    client, script = scripted()
    for send in (
        lambda: client.submit([{"prompt": "a person walks"}], name="Zo\udceb"),
        lambda: client.post("/v1/motions/review", {"comment": "\udcff"}),
    ):
        with pytest.raises(InvalidInput, match=r"udc.. is no UTF-8|'\\udc..' is no UTF-8"):
            send()
    assert script.asked == []


DEEP = "[" * 100_000


@pytest.mark.parametrize("answer", ["a text", 1, None])
def test_an_answer_that_is_no_object_or_array_is_not_the_api_s(scripted: Scripted, answer: object) -> None:
    client, _ = scripted((200, answer))
    with client, pytest.raises(InvalidInput, match="the API answers JSON"):
        client.get("/v1/jobs")


@pytest.mark.parametrize(
    "problems", [[{"line": 1}], [{"line": "a", "message": "b"}], ["a"], 3, [{"line": [], "message": "b"}]]
)
def test_problems_of_items_that_cannot_be_read_are_not_the_api_s(scripted: Scripted, problems: object) -> None:
    client, _ = scripted((422, problem("invalid-items", problems=problems)))
    with client, pytest.raises(InvalidInput, match="and not the API"):
        client.submit([{"prompt": "a person walks"}])


@pytest.mark.parametrize("status", [200, 422])
def test_json_nested_without_end_is_not_the_api_s(scripted: Scripted, status: int) -> None:
    client, script = scripted()
    script.answers.append((status, DEEP.encode()))
    with client, pytest.raises(InvalidInput, match="the API"):
        client.get("/v1/jobs")


def test_what_no_url_can_hold_is_a_wrong_input(scripted: Scripted) -> None:
    client, _ = scripted()
    with client, pytest.raises(InvalidInput, match="cannot be asked for"):
        client.get("/v1/models/x\x1b[31m")
    with pytest.raises(InvalidInput, match="is no address"):
        Transport(Server("http://127.0.0.1:9/\x1b[31m", "key"))
