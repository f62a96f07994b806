"""Bytes that are no HTTP request get a problem, as refused requests do."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator
from contextlib import suppress
from urllib.parse import urlsplit

import pytest
import uvicorn
from starlette.responses import PlainTextResponse

from marey.http.connections import PatientProtocol
from tests.support.live_api import wait_until
from tests.support.raw_http import GENEROUS, RawClient


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
        b"GET / HTTP/1.1\r\nHost: a\r\nX: " + b"x" * 2**16 + b"\r\n\r\n",
        b"GET /?" + b"x" * 2**16 + b" HTTP/1.1\r\nHost: a\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost: a\r\n" + b"X: y\r\n" * 11000 + b"\r\n",
    ],
)
def test_bytes_that_are_no_request(url: str, head: bytes) -> None:
    with RawClient(url) as client:
        client.send(head)
        answer = client.answer()
    assert (answer.status, answer.ended, answer.headers["connection"]) == (400, True, "close")
    assert answer.problem["type"] == "urn:marey:problem:malformed-request"
    assert "not valid HTTP" in answer.problem["detail"]


def head_of(size: int) -> bytes:
    begin, end = b"GET / HTTP/1.1\r\nHost: a\r\nX: ", b"\r\n\r\n"
    return begin + b"x" * (size - len(begin) - len(end)) + end


def test_a_head_of_64_kib_is_read_and_one_byte_more_is_refused(url: str) -> None:
    with RawClient(url) as client:
        client.send(head_of(2**16))
        assert client.answer().body == b"here"
        client.send(head_of(2**16 + 1))
        assert client.answer().status == 400


def test_a_long_head_behind_another_request_is_refused(url: str) -> None:
    address = urlsplit(url)
    with socket.create_connection((str(address.hostname), address.port), timeout=GENEROUS) as connection:
        connection.sendall(head_of(100) + head_of(2**17))
        answers = b""
        with suppress(ConnectionResetError):  # the server closes before it has read all
            while part := connection.recv(2**16):
                answers += part
    assert answers.count(b"here") < 2


def test_a_request_of_such_a_server_is_answered(url: str) -> None:
    with RawClient(url) as client:
        client.send(b"GET / HTTP/1.1\r\nHost: a\r\n\r\n")
        assert client.answer().body == b"here"
