"""`/v1/webhooks` and `marey webhooks` against a real API, with scheduler, worker and receiver beside it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any
from uuid import uuid4

import httpx2
import pytest
from standardwebhooks.webhooks import Webhook

from marey.cli.ports import try_port
from marey.db import transaction
from marey.webhooks import EventKind
from tests.servers.receiver import Receiver, hang, status
from tests.support.command import Command
from tests.support.evaluations import GENERATOR, wait
from tests.support.live_api import ApiThread
from tests.support.live_evaluations import Studio
from tests.support.marey import Ran
from tests.support.webhooks import VAULT, delivering

HOOK = "https://studio.example/marey"
Marey = Callable[..., Ran]
"""`marey webhooks`, in this process."""


@pytest.fixture
def http(place: Studio) -> Iterator[httpx2.Client]:
    with place.api.http() as client:
        yield client
        for each in client.get("/v1/webhooks", params={"limit": 1000}).json()["items"]:
            assert client.delete(f"/v1/webhooks/{each['id']}").status_code == 204


@pytest.fixture
def receiver() -> Iterator[Receiver]:
    with Receiver() as made:
        yield made


def make(http: httpx2.Client, url: str = HOOK, **fields: object) -> dict[str, Any]:
    response = http.post("/v1/webhooks", json={"url": url, **fields})
    assert response.status_code == 201, response.text
    assert response.headers["location"] == f"/v1/webhooks/{response.json()['id']}"
    return response.json()


def refused(response: httpx2.Response, code: int, kind: str) -> dict[str, Any]:
    assert response.status_code == code, response.text
    assert response.json()["type"] == f"urn:marey:problem:{kind}"
    return response.json()


@pytest.fixture
def marey(place: Studio) -> Marey:
    command = Command({"MAREY_SERVER": place.api.url, "MAREY_KEY": place.api.key})
    return lambda *arguments: command("webhooks", *arguments)


# --- the routes ---


def test_a_webhook_shows_its_secret_once_and_the_database_never_holds_it(place: Studio, http: httpx2.Client) -> None:
    made = make(http, events=["job.ended"], name="farm")
    secret = made.pop("secret")
    Webhook(secret)
    assert secret.startswith("whsec_")
    assert (made["url"], made["events"], made["name"], made["paused"]) == (HOOK, ["job.ended"], "farm", False)
    assert http.get(f"/v1/webhooks/{made['id']}").json() == made
    assert http.get("/v1/webhooks").json()["items"] == [made]
    with transaction(place.api.engine) as conn:
        stored = bytes(conn.exec_driver_sql("SELECT secret FROM webhook").scalar_one())
    assert secret.encode() not in stored
    assert VAULT.decrypt(stored) == secret
    assert make(http)["events"] == sorted(EventKind)


def test_a_secret_is_rotated_and_shown_once(http: httpx2.Client) -> None:
    made = make(http)
    path = f"/v1/webhooks/{made['id']}"
    rotated = http.post(f"{path}/rotate").json()
    assert rotated["secret"].startswith("whsec_")
    assert rotated["secret"] != made["secret"]
    assert "secret" not in http.get(path).json()
    refused(http.post(f"{path}/rotate", params={"overlap_hours": 721}), 422, "invalid-input")


def test_what_is_given_is_changed_and_nothing_else(http: httpx2.Client) -> None:
    made = make(http, name="farm")
    path = f"/v1/webhooks/{made['id']}"
    changed = http.patch(path, json={"paused": True, "events": ["job.paused", "job.paused"]}).json()
    assert changed == {**{k: v for k, v in made.items() if k != "secret"}, "paused": True, "events": ["job.paused"]}
    assert http.patch(path, json={"url": "https://other.example/"}).json()["url"] == "https://other.example/"
    assert http.patch(path, json={"paused": False}).json()["paused"] is False
    assert http.delete(path).status_code == 204
    refused(http.get(path), 404, "not-found")


@pytest.mark.parametrize(
    ("url", "said"),
    [
        ("http://studio.example@10.0.0.1/", "holds a user"),
        ("https://10.0.0.1/hook", "private address"),
        ("https://169.254.169.254/latest/meta-data", "private address"),
        ("https://[::ffff:10.0.0.1]/", "private address"),
        ("https://167772161/", "private address"),
        ("http://8.8.8.8/", "http is allowed only for the networks in MAREY_WEBHOOK_ALLOW"),
        ("file:///etc/passwd", "is not an https URL"),
    ],
)
def test_an_address_that_may_not_be_told_is_refused_when_it_is_named(http: httpx2.Client, url: str, said: str) -> None:
    made = make(http)
    for response in (
        http.post("/v1/webhooks", json={"url": url}),
        http.patch(f"/v1/webhooks/{made['id']}", json={"url": url}),
    ):
        problem = refused(response, 422, "invalid-input")
        assert problem["where"] == "url"
        assert said in problem["detail"]
    assert [each["url"] for each in http.get("/v1/webhooks").json()["items"]] == [HOOK]


def test_bad_bodies_name_their_field(http: httpx2.Client) -> None:
    for body, field in (
        ({}, "url"),
        ({"url": HOOK, "events": []}, "events"),
        ({"url": HOOK, "events": ["job.began"]}, "events"),
        ({"url": HOOK, "events": ["webhook.test"]}, "events"),
        ({"url": HOOK, "secret": "mine"}, "secret"),
        ({"url": HOOK, "name": "x" * 201}, "name"),
    ):
        assert field in refused(http.post("/v1/webhooks", json=body), 422, "invalid-input")["where"]


def test_a_key_needs_the_scope_operate_and_another_tenant_sees_nothing(place: Studio, http: httpx2.Client) -> None:
    path = f"/v1/webhooks/{make(http)['id']}"
    event = http.post(f"{path}/test").json()["event"]
    delivery = f"{path}/deliveries/{event}"
    reads = [("GET", path), ("GET", f"{path}/deliveries"), ("GET", delivery)]
    writes: list[tuple[str, str]] = [("POST", f"{path}/test"), ("POST", f"{delivery}/replay"), ("DELETE", path)]
    with place.http("read", "submit") as reader, place.http("admin", tenant="rival") as rival:
        assert [reader.request(*each).status_code for each in reads] == [200] * 3
        for method, where in (*writes, ("PATCH", path), ("POST", "/v1/webhooks")):
            body = {"url": HOOK} if method == "PATCH" or where == "/v1/webhooks" else None
            refused(reader.request(method, where, json=body), 403, "refused")
        for method, where in (*reads, *writes, ("PATCH", path)):
            body = {"paused": True} if method == "PATCH" else None
            refused(rival.request(method, where, json=body), 404, "not-found")
        assert rival.get("/v1/webhooks").json()["items"] == []
    assert http.get(path).json()["paused"] is False


def test_a_server_without_a_key_for_secrets_says_so(place: Studio) -> None:
    config = place.config.model_copy(update={"webhook_key": None, "port": try_port("127.0.0.1", 0)})
    with ApiThread(config) as url:
        headers = {"Authorization": f"Bearer {place.api.key}"}
        problem = refused(httpx2.post(f"{url}/v1/webhooks", json={"url": HOOK}, headers=headers), 403, "refused")
    assert problem["where"] == "MAREY_WEBHOOK_KEY"


# --- the whole way ---


def test_an_evaluation_that_is_worse_reaches_the_receiver_signed(
    place: Studio, http: httpx2.Client, receiver: Receiver
) -> None:
    made = make(http, receiver.url(), events=["evaluation.ended", "evaluation.regressed"])
    prompts = [{"prompt": f"walk {n} steps"} for n in range(3)]

    def run() -> str:
        body = {"bundle": GENERATOR, "prompts": prompts, "source": "studio.csv"}
        return http.post("/v1/evaluations", json=body).json()["id"]

    first = run()
    place.work()
    place.judge.forget = 1
    try:
        second = run()
        place.work()
    finally:
        place.judge.forget = 0
    with delivering(place.api.engine, place.config.api_url):
        received = receiver.wait(3)
    documents = [Webhook(made["secret"]).verify(each.body, each.headers) for each in received]
    messages_of = sorted((each["data"]["evaluation"], each["type"], each["data"]["regressed"]) for each in documents)
    assert messages_of == [(first, "evaluation.ended", None), (second, "evaluation.ended", True),
                    (second, "evaluation.regressed", True)]  # fmt: skip
    url = documents[0]["data"]["urls"]["evaluation"]
    assert http.get(url).json()["id"] == documents[0]["data"]["evaluation"]
    assert b"walk" not in b"".join(each.body for each in received)


# --- the command line ---


def test_a_webhook_is_added_tried_out_paused_and_removed(
    place: Studio, http: httpx2.Client, marey: Marey, receiver: Receiver
) -> None:
    said = marey("add", receiver.url(), "--event", "job.ended", "--event", "job.paused", "--name", "farm").ok()
    webhook, secret = said.out.strip().split("\t")
    assert "shown only now" in said.err
    line = [webhook, "farm", receiver.url(), "job.ended, job.paused", "", "0", "0"]
    assert [each.split("\t") for each in marey("list").ok().out.splitlines()] == [line]
    assert secret not in marey("list", "--json").out + marey("show", webhook, "--json").out
    rotated = marey("rotate", webhook, "--overlap-hours", 1).ok()
    assert (rotated.out.startswith("whsec_"), "1 hours more" in rotated.err) == (True, True)
    with delivering(place.api.engine, place.config.api_url):
        said = marey("test", webhook, "--wait").ok()
        assert (said.out.strip(), "it arrived: 200" in said.err) == (receiver.received[0].id, True)
        receiver.answer = status(500)
        marey("test", webhook, "--wait").refused(6, "it did not arrive: answered 500")
    marey("test", webhook, "--wait", "--timeout", 0).refused(7, "no attempt was made in time")
    assert "is paused" in marey("pause", webhook).ok().err
    assert "paused    paused" in marey("show", webhook).ok().out
    marey("test", webhook).refused(2, "the webhook is paused", f"marey webhooks resume {webhook}")
    assert "goes on" in marey("resume", webhook).ok().err
    marey("remove", webhook, "--yes").ok()
    marey("show", webhook).refused(3, "there is no such webhook")


def test_deliveries_are_listed_with_their_tries_and_made_again(
    place: Studio, http: httpx2.Client, marey: Marey, receiver: Receiver
) -> None:
    webhook = marey("add", receiver.url(), "--json").ok().lines[0]["id"]
    receiver.answer = status(404)
    with delivering(place.api.engine, place.config.api_url):
        for _ in range(2):
            marey("test", webhook, "--wait").refused(6, "answered 404")
        failed = marey("deliveries", webhook, "--state", "failed", "--json").ok().lines
        assert [(each["attempts"], each["status"]) for each in failed] == [(1, 404)] * 2
        receiver.answer = status(204)
        assert "2 deliveries are made again" in marey("replay", webhook, "--failed").ok().err
        wait(lambda: len(marey("deliveries", webhook, "--state", "delivered", "--json").ok().lines) == 2)
        event = failed[0]["event"]
        tries = marey("deliveries", webhook, event).ok()
        assert [row.split("\t")[2] for row in tries.out.splitlines()] == ["404", "204"]
        assert "webhook.test is delivered" in tries.err
        receiver.answer = hang
        marey("replay", webhook, event).ok()
        receiver.wait(5)
        assert marey("deliveries", webhook, "--limit", 1).ok().out.split("\t")[2] == "pending"
        receiver.released.set()
    for arguments, code, said in (
        (["replay", webhook], 2, "give ids of events, or --failed"),
        (["replay", webhook, uuid4()], 3, "no such delivery"),
        (["deliveries", uuid4()], 3, "there is no such webhook"),
        (["add", "https://10.0.0.1/"], 2, "private address"),
        (["add", HOOK, "--event", "job.began"], 2, "job.ended"),
    ):
        marey(*arguments).refused(code, said)
