"""Bytes that are no HTTP request get a problem, as refused requests do."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import pytest
import uvicorn
from starlette.responses import PlainTextResponse

from marey.http.connections import PatientProtocol
from tests.support.live_api import wait_until
from tests.support.raw_http import RawClient


@pytest.fixture(scope="module")
def url() -> Iterator[str]:
    config = uvicorn.Config(PlainTextResponse("here"), http=PatientProtocol, port=0, log_config=None)
    server = uvicorn.Server(config)
    listening = config.bind_socket()
    thread = threading.Thread(target=server.run, args=([listening],), daemon=True)
    thread.start()
    wait_until(lambda: server.started)
    yield f"http://127.0.0.1:{listening.getsockname()[1]}"
    server.should_exit = True
    thread.join()


@pytest.mark.parametrize(
    "head",
    [
        b"GET / HTTP/1.1\r\n\r\n",
        b"GET /a b HTTP/1.1\r\nHost: a\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost: a\r\nContent-Length: x\r\n\r\n",
        b"\x16\x03\x01\x02\x00\x01\r\n\r\n",  # the beginning of TLS
        b"GET / HTTP/1.1\r\nHost: a\r\nX: " + b"x" * 2**17,
    ],
)
def test_bytes_that_are_no_request(url: str, head: bytes) -> None:
    with RawClient(url) as client:
        client.send(head)
        answer = client.answer()
    assert (answer.status, answer.ended, answer.headers["connection"]) == (400, True, "close")
    assert answer.problem["type"] == "urn:marey:problem:malformed-request"
    assert "not valid HTTP" in answer.problem["detail"]


def test_a_request_of_such_a_server_is_answered(url: str) -> None:
    with RawClient(url) as client:
        client.send(b"GET / HTTP/1.1\r\nHost: a\r\n\r\n")
        assert client.answer().body == b"here"
