"""Clients that are slow, endless or lie about their length: answered, let go, and no burden to others."""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor, wait

import pytest

from marey.embedded import EmbeddedServer
from tests.support.live_api import LiveApi, running_api, settings_of
from tests.support.raw_http import RawClient, RawResponse

SECONDS = 2.0
"""Every limit of these tests' server."""
MIB = 2**20
HOST = "Host: 127.0.0.1\r\n"
SLOWLY = 0.05
"""Seconds between two bytes."""


@pytest.fixture(scope="module")
def api(
    module_database_url: str, valkey: EmbeddedServer, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[LiveApi]:
    config = settings_of(tmp_path_factory.mktemp("api"), module_database_url, valkey.url).model_copy(
        update={"idle_seconds": SECONDS, "body_pause_seconds": SECONDS, "body_seconds": 2 * SECONDS}
    )
    with running_api(config, module_database_url) as api:
        yield api


def head(api: LiveApi, *headers: str, path: str = "/v1/jobs") -> bytes:
    lines = [f"POST {path} HTTP/1.1", "Host: 127.0.0.1", f"Authorization: Bearer {api.key}", *headers, "", ""]
    return "\r\n".join(lines).encode()


LENGTH, CHUNKED = "Content-Length: 5000", "Transfer-Encoding: chunked"
LINES = "Content-Type: application/x-ndjson"
SLOW: dict[str, Callable[[LiveApi], Iterator[bytes]]] = {
    "a head, a byte at a time": lambda api: (b"%c" % byte for byte in itertools.cycle(head(api)[:-4])),
    "a body, a byte at a time": lambda api: itertools.chain([head(api, LENGTH)], itertools.repeat(b" ")),
    "a small body, a byte at a time": lambda api: itertools.chain(
        [head(api, LENGTH, path="/v1/webhooks")], itertools.repeat(b" ")
    ),
    "a body in chunks of a byte": lambda api: itertools.chain([head(api, CHUNKED)], itertools.repeat(b"1\r\n \r\n")),
    "a body that stops": lambda api: iter([head(api, LENGTH), b"[" * 4000]),
    "a body without an end": lambda api: itertools.chain(
        [head(api, CHUNKED, LINES)], itertools.repeat(b"400\r\n" + b" " * 1024 + b"\r\n")
    ),
}


@pytest.fixture(scope="module")
def answers(api: LiveApi) -> Iterator[dict[str, RawResponse]]:
    """Final answers to all waiting clients, with a plain client beside them."""

    def ask(parts: Iterator[bytes]) -> RawResponse:
        with RawClient(api.url) as client:
            return client.dribble(parts, SLOWLY)

    with ThreadPoolExecutor(len(SLOW)) as pool, api.http() as http:
        asked = {name: pool.submit(ask, parts(api)) for name, parts in SLOW.items()}
        while wait(asked.values(), timeout=0.2).not_done:
            assert http.get("/v1/jobs").status_code == 200
        yield {name: answer.result() for name, answer in asked.items()}


@pytest.mark.parametrize("name", SLOW)
def test_whoever_is_slow_is_told_so_and_let_go(answers: dict[str, RawResponse], name: str) -> None:
    answer = answers[name]
    assert answer.status == 408
    assert answer.headers["connection"] == "close"
    assert answer.ended
    assert answer.problem["type"] == "urn:marey:problem:too-slow"
    assert "head" in name or answer.problem["where"] == "body"


def test_a_slow_body_leaves_nothing_behind(api: LiveApi, answers: dict[str, RawResponse]) -> None:
    assert answers
    with api.http() as http:
        assert http.get("/v1/jobs").json()["items"] == []


def test_a_connection_that_asks_nothing_is_closed_without_a_word(api: LiveApi) -> None:
    with RawClient(api.url) as silent:
        assert silent.answer() == RawResponse(0, {}, b"", True)


def test_a_connection_that_asks_nothing_more_is_closed(api: LiveApi) -> None:
    with RawClient(api.url) as client:
        client.send(f"GET /livez HTTP/1.1\r\n{HOST}\r\n".encode())
        assert client.answer().status == 200
        client.send(b"GET /livez")  # uvicorn alone would wait for the rest for ever
        assert client.answer().status == 408


def test_a_length_over_the_limit_is_refused_before_a_byte_of_it_came(api: LiveApi) -> None:
    for path in ("/v1/jobs", "/v1/webhooks"):
        with RawClient(api.url) as client:
            client.send(head(api, "Content-Length: 10000000000", path=path))
            answer = client.answer()
            assert (answer.status, answer.ended, answer.problem["where"]) == (413, True, "body")


@pytest.mark.parametrize(
    ("path", "limit"), [("/v1/jobs", 64), ("/v1/evaluations", 64), ("/v1/webhooks", 1), ("/v1/texts/parse", 1)]
)
def test_a_body_that_does_not_say_its_length_is_read_to_the_limit_and_no_further(
    api: LiveApi, path: str, limit: int
) -> None:
    chunk = b"%x\r\n" % MIB + b" " * MIB + b"\r\n"
    with RawClient(api.url) as client:
        answer = client.dribble(itertools.chain([head(api, CHUNKED, LINES, path=path)], itertools.repeat(chunk)))
        assert (answer.status, answer.ended) == (413, True)
        assert answer.problem["detail"] == f"the body is over {limit} MiB"
        assert client.sent < (limit + 32) * MIB  # what the kernel's buffers hold comes on top


def test_a_body_longer_than_it_says_is_not_taken_for_more(api: LiveApi) -> None:
    body = b'{"items": [{"prompt": "a person walks"}]}'
    with RawClient(api.url) as client:
        client.send(head(api, f"Content-Length: {len(body)}") + body + b"more\r\n\r\n")
        assert client.answer().status == 202
    with api.http() as http:
        assert len(http.get("/v1/jobs").json()["items"]) == 1


def test_a_request_with_two_lengths_is_refused_and_none_is_taken_from_behind_it(api: LiveApi) -> None:
    """A proxy that heeds the length would take what follows for the body, the server for another request."""
    behind = f"GET /livez HTTP/1.1\r\n{HOST}\r\n".encode()
    for path in ("/v1/jobs", "/v1/motions/review"):
        with RawClient(api.url) as client:
            length = f"Content-Length: {5 + len(behind)}"
            client.send(head(api, length, CHUNKED, path=path) + b"0\r\n\r\n" + behind)
            answer = client.answer()
        assert (answer.status, answer.headers["connection"], answer.ended) == (400, "close", True)
        assert "both Content-Length and Transfer-Encoding" in answer.problem["detail"]


def test_a_body_of_somebody_without_a_key_is_not_read(api: LiveApi) -> None:
    lines = f"POST /v1/jobs HTTP/1.1\r\n{HOST}{CHUNKED}\r\n\r\n".encode()
    chunk = b"%x\r\n" % MIB + b" " * MIB + b"\r\n"
    with RawClient(api.url) as client:
        answer = client.dribble(itertools.chain([lines], itertools.repeat(chunk)))
        assert (answer.status, answer.ended) == (401, True)
        assert client.sent < 32 * MIB


def test_a_client_that_leaves_in_the_middle_is_no_error_of_the_server(
    api: LiveApi, capfd: pytest.CaptureFixture[str]
) -> None:
    for path in ("/v1/jobs", "/v1/webhooks"):
        with RawClient(api.url) as client:
            client.send(head(api, LENGTH, path=path) + b" " * 100)
    with api.http() as http:
        assert http.get("/v1/jobs").status_code == 200
    assert not re.search("internal_error|Traceback", capfd.readouterr().err)


def test_a_packed_body_is_refused_by_name(api: LiveApi) -> None:
    with api.http() as http:
        answer = http.post("/v1/jobs", content=b"\x1f\x8b", headers={"Content-Encoding": "gzip"})
    assert (answer.status_code, answer.json()["where"]) == (422, "Content-Encoding")
