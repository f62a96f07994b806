"""The client behind a proxy that answers in Marey's place: what is said, and what is tried again."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest

from marey.client import retries, stream_socket
from marey.client.retries import ATTEMPTS
from marey.client.server_address import Server
from marey.client.stream_socket import Link
from marey.client.transport import Transport
from marey.core.errors import InvalidInput, MareyError, NotFound, Refused, TooLarge, TooSlow, Unreachable
from tests.servers.receiver import Authority
from tests.support.proxied import receive_until_refused

NGINX = b"<html><head><title>413 Request Entity Too Large</title></head><center>nginx/1.22.1</center></html>"
PLAIN = b"<html><center>The plain HTTP request was sent to HTTPS port</center></html>"


class Proxy:
    """Answers every request with one page, and counts them."""

    def __init__(self, status: int, body: bytes = NGINX, **headers: str) -> None:
        self.requests = 0
        proxy = self

        class Handler(BaseHTTPRequestHandler):
            server_version, sys_version = "nginx/1.22.1", ""
            protocol_version = "HTTP/1.1"

            def answer(self) -> None:
                proxy.requests += 1
                self.rfile.read(int(self.headers.get("Content-Length", 0)))
                self.send_response(status)
                for name, value in {"Content-Type": "text/html", **headers}.items():
                    self.send_header(name, value)
                self.send_header("Content-Length", str(len(body)))
                self.end_headers()
                self.wfile.write(body)

            do_GET = do_POST = do_DELETE = answer

            def log_message(self, format: str, *_: object) -> None:
                pass

        self.http = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.url = f"http://127.0.0.1:{self.http.server_port}"
        self.server = Server(self.url, "key")
        threading.Thread(target=self.http.serve_forever, args=(0.05,), daemon=True).start()


Start = Callable[..., Proxy]


@pytest.fixture
def start(monkeypatch: pytest.MonkeyPatch) -> Iterator[Start]:
    monkeypatch.setattr(retries, "FIRST_PAUSE", 0.001)
    started: list[Proxy] = []

    def begin(status: int, body: bytes = NGINX, **headers: str) -> Proxy:
        started.append(Proxy(status, body, **headers))
        return started[-1]

    yield begin
    for proxy in started:
        proxy.http.shutdown()
        proxy.http.server_close()


@pytest.mark.parametrize(
    ("status", "error", "said", "requests"),
    [
        (413, TooLarge, "client_max_body_size 64m", 1),
        (408, TooSlow, "slower than it waits", 1),
        (502, Unreachable, "gets no answer from the API", ATTEMPTS),
        (503, Unreachable, "no API to pass requests on to", ATTEMPTS),
        (504, Unreachable, "proxy_read_timeout", ATTEMPTS),
        (500, Unreachable, "without a reason", 1),
        (401, Refused, "and not the API", 1),
        (404, InvalidInput, "Is MAREY_SERVER", 1),
    ],
)
def test_a_page_of_a_proxy_is_told_as_such(
    start: Start, status: int, error: type[MareyError], said: str, requests: int
) -> None:
    proxy = start(status)
    with Transport(proxy.server) as client, pytest.raises(error, match=r"a proxy \(nginx/1.22.1\) answered") as told:
        client.submit([{"prompt": "a person walks"}])
    assert said in str(told.value)
    assert proxy.requests == requests


@pytest.mark.parametrize("named", ["socks5://127.0.0.1:1", "ftp://a", "http://127.0.0.1:1"])
def test_a_server_on_this_machine_is_not_asked_for_by_a_proxy(
    start: Start, monkeypatch: pytest.MonkeyPatch, named: str
) -> None:
    monkeypatch.setenv("ALL_PROXY", named)
    proxy = start(500)
    for url in (proxy.url, proxy.url.replace("127.0.0.1", "localhost")):
        with Transport(Server(url, "key")) as client, pytest.raises(Unreachable, match="nginx"):
            client.get("/v1/jobs")
    assert proxy.requests == 2


@pytest.mark.parametrize(("named", "said"), [("socks5://127.0.0.1:1", "SOCKS is not supported"), ("ftp://a", "ftp")])
def test_a_proxy_that_cannot_be_used_is_told(monkeypatch: pytest.MonkeyPatch, named: str, said: str) -> None:
    monkeypatch.setenv("ALL_PROXY", named)
    with pytest.raises(InvalidInput, match=f"a proxy that the environment names .*{said}(.*\n)*.*ALL_PROXY"):
        Transport(Server("http://marey.example.com", "key"))


def test_a_name_that_would_control_a_terminal_is_not_shown(start: Start) -> None:
    proxy = start(404, Server="x\x1b[2J")
    proxy.http.RequestHandlerClass.server_version = "evil\x1b[2J"  # pyright: ignore[reportAttributeAccessIssue]
    with Transport(proxy.server) as client, pytest.raises(InvalidInput) as told:
        client.get("/v1/jobs")
    assert "\x1b" not in str(told.value)
    assert "a proxy or another server answered 404" in str(told.value)


@pytest.mark.parametrize(
    ("status", "headers", "said"),
    [
        (301, {"Location": "https://marey.example.com/v1/jobs?x=1"}, "a redirect to https://marey.example.com\n"),
        (302, {"Location": "\x1b[2J"}, "a redirect\n"),
        (200, {}, "answered 200 with text/html, where the API answers JSON"),
    ],
    ids=["to https", "senseless", "page of a login"],
)
@pytest.mark.parametrize("verb", ["get", "delete"])
def test_neither_a_redirect_nor_a_page_counts_as_done(
    start: Start, status: int, headers: dict[str, str], said: str, verb: str
) -> None:
    with Transport(start(status, **headers).server) as client, pytest.raises(InvalidInput) as told:
        getattr(client, verb)("/v1/jobs")
    assert said in str(told.value)


def test_https_to_a_port_of_http_and_the_reverse_are_told(start: Start) -> None:
    proxy = start(400, PLAIN)
    with Transport(proxy.server) as client, pytest.raises(InvalidInput, match="Begin MAREY_SERVER with https"):
        client.get("/v1/jobs")
    secure = Server(proxy.url.replace("http", "https"), "key")
    with Transport(secure) as client, pytest.raises(InvalidInput, match="Begin MAREY_SERVER with http:"):
        client.get("/v1/jobs")
    with Link(proxy.server, "s") as link, pytest.raises(InvalidInput, match="Begin MAREY_SERVER with https"):
        link.receive(1)


@pytest.mark.parametrize(
    ("status", "body"), [(200, b'{"id": "s"}'), (400, NGINX), (405, NGINX), (422, b"{}"), (426, b"")]
)
def test_a_websocket_that_lost_its_upgrade_is_told_at_once(start: Start, status: int, body: bytes) -> None:
    proxy = start(status, body)
    with Link(proxy.server, "s") as link, pytest.raises(InvalidInput, match="does not pass on the upgrade") as told:
        link.receive(1)
    assert "Upgrade and Connection" in str(told.value)
    assert proxy.requests == 1


@pytest.mark.parametrize("status", [429, 502, 503, 504])
def test_a_proxy_without_an_api_is_tried_again(start: Start, status: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stream_socket, "FIRST_PAUSE", 0.01)
    proxy = start(status)
    with Link(proxy.server, "s", patience=0.5) as link, pytest.raises(Unreachable, match="out of reach"):
        receive_until_refused(link)
    assert proxy.requests > 1


def test_a_socket_refused_by_the_api_is_told_in_its_words_and_by_a_proxy_in_ours(start: Start) -> None:
    problem = b'{"type": "urn:marey:problem:not-found", "detail": "no such stream"}'
    with Link(start(404, problem).server, "s") as link, pytest.raises(NotFound, match="no such stream"):
        link.receive(1)
    with Link(start(403).server, "s") as link, pytest.raises(Refused, match="nginx"):
        link.receive(1)


def test_a_file_of_authorities_that_is_none_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MAREY_CA_FILE", str(tmp_path / "none.pem"))
    with pytest.raises(InvalidInput, match="cannot be read") as told:
        Transport(Server("http://127.0.0.1:1", "key"))
    assert told.value.where == "MAREY_CA_FILE"
    assert Authority.make(tmp_path).file.exists()
