"""Web pages of other origins: none by default, else those of an exact list, for answers and sockets alike."""

from __future__ import annotations

import pytest
from starlette.testclient import TestClient, WebSocketDenialResponse
from starlette.types import Receive, Scope, Send

from marey.api.app import create_app
from marey.core.origins import check_origins, origin_of
from marey.core.settings import Settings
from marey.http.guards import HostGuard

APP, STRANGER = "https://app.example.com", "https://evil.example"


def client(**settings: object) -> TestClient:
    return TestClient(create_app(Settings.model_validate(settings)), base_url="http://localhost")


@pytest.fixture(scope="module")
def open_to_app() -> TestClient:
    return client(cors_origins=[APP, "http://localhost:3000"])


def cors(answer: object) -> dict[str, str]:
    return {name: value for name, value in answer.headers.items() if name.startswith("access-control-")}


def preflight(to: TestClient, origin: str, method: str = "POST") -> object:
    headers = {"Origin": origin, "Access-Control-Request-Method": method, "Access-Control-Request-Headers": "x" * 4000}
    return to.options("/v1/jobs", headers=headers)


def test_by_default_no_page_reads_answers() -> None:
    closed = client()
    assert cors(closed.get("/openapi.json", headers={"Origin": APP})) == {}
    answer = preflight(closed, APP)
    assert (answer.status_code, cors(answer)) == (405, {})


def test_a_listed_origin_reads_answers_and_their_headers(open_to_app: TestClient) -> None:
    answer = open_to_app.get("/openapi.json", headers={"Origin": APP})
    assert cors(answer)["access-control-allow-origin"] == APP
    assert "Content-Disposition" in cors(answer)["access-control-expose-headers"]
    assert "access-control-allow-credentials" not in answer.headers
    assert "Origin" in answer.headers["vary"]
    refused = open_to_app.get("/v1/jobs?x=" + 9 * "y", headers={"Origin": APP, "Content-Length": "x"})
    assert refused.status_code >= 400
    assert cors(refused)["access-control-allow-origin"] == APP  # a page can show what was wrong


@pytest.mark.parametrize(
    "origin", [STRANGER, "null", APP + ".evil.example", "http://app.example.com", APP + ":8443", "*"]
)
def test_another_origin_does_not(open_to_app: TestClient, origin: str) -> None:
    answer = open_to_app.get("/openapi.json", headers={"Origin": origin})
    assert (answer.status_code, cors(answer), answer.headers["vary"]) == (200, {}, "Origin")
    answer = preflight(open_to_app, origin)
    assert (answer.status_code, cors(answer)) == (403, {})
    assert "MAREY_CORS_ORIGINS" in answer.json()["hint"]


def test_a_preflight_is_answered_without_a_key_and_with_fixed_lists(open_to_app: TestClient) -> None:
    answer = preflight(open_to_app, "http://localhost:3000")
    assert (answer.status_code, answer.content) == (204, b"")
    assert cors(answer) == {
        "access-control-allow-origin": "http://localhost:3000",
        "access-control-allow-methods": "DELETE, GET, HEAD, PATCH, POST",
        "access-control-allow-headers": "Authorization, Content-Type, Idempotency-Key, If-None-Match, If-Range, "
        "Last-Event-ID, Range",
        "access-control-max-age": "600",
    }
    foreign = open_to_app.get("/openapi.json", headers={"Origin": APP, "Host": "rebound.example"})
    assert foreign.status_code == 403  # the check of the host stays


def test_every_method_of_the_api_is_among_those_of_a_preflight(open_to_app: TestClient) -> None:
    paths = open_to_app.get("/openapi.json").json()["paths"].values()
    methods = {method.upper() for path in paths for method in path if method != "parameters"}
    assert methods <= set(cors(preflight(open_to_app, APP))["access-control-allow-methods"].split(", "))


def opened(origin: str, hosts: list[str], origins: list[str]) -> bool:
    """True if a socket of a page of this origin gets past the guard to the application."""

    async def accept(scope: Scope, receive: Receive, send: Send) -> None:
        await send({"type": "websocket.accept"})

    guarded = HostGuard(accept, allowed=hosts, origins=origins)
    try:
        with TestClient(guarded).websocket_connect("ws://localhost/", headers={"Origin": origin}):
            return True
    except WebSocketDenialResponse as refused:
        return refused.status_code != 403


@pytest.mark.parametrize("hosts", [["localhost"], ["*"]])
def test_sockets_are_for_own_pages_and_those_of_the_same_list(hosts: list[str]) -> None:
    for origin in (STRANGER, "null", "http://app.example.com", APP + ":8443"):
        assert not opened(origin, hosts, [])
        assert not opened(origin, hosts, [APP])
    assert not opened(APP, hosts, [])
    assert opened(APP, hosts, [APP])
    assert opened("http://localhost:3000", hosts, [])


@pytest.mark.parametrize(
    ("text", "origin"),
    [
        ("https://App.Example.com:443", "https://app.example.com"),
        ("http://localhost:3000", "http://localhost:3000"),
        ("http://[::1]:80", "http://[::1]"),
        ("https://app.example.com/", None),
        ("https://user@app.example.com", None),
        ("https://*.example.com", None),
        ("https://app.example.com:99999", None),
        ("file://", None),
        ("*", None),
        ("null", None),
    ],
)
def test_origins_are_compared_in_one_form(text: str, origin: str | None) -> None:
    assert origin_of(text) == origin


def test_an_origin_that_is_given_twice_counts_once() -> None:
    assert check_origins(["https://a.example", "https://A.example:443"]) == ["https://a.example"]
