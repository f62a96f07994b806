"""One request to a receiver that answers, refuses, hangs, redirects, talks for ever, or has another identity."""

from __future__ import annotations

import asyncio
import socket
import ssl
from collections.abc import Iterator

import pytest

from marey.core.addresses import Allowed
from marey.scheduler.sending import Sender
from marey.webhooks import Attempt
from tests.servers.receiver import LOOPBACK, Authority, Receiver, drip, endless, hang, stalling, status

BODY = b'{"type":"job.ended"}'


@pytest.fixture(scope="module")
def receiver() -> Iterator[Receiver]:
    with Receiver() as made:
        yield made


@pytest.fixture(autouse=True)
def _forgetful(receiver: Receiver) -> None:
    receiver.received.clear()
    receiver.answer = status(200)


@pytest.fixture(scope="module")
def authority(tmp_path_factory: pytest.TempPathFactory) -> Authority:
    return Authority.make(tmp_path_factory.mktemp("authority"))


def send(url: str, allow: list[str] = LOOPBACK, *, tls: ssl.SSLContext | None = None, seconds: float = 10) -> Attempt:
    sender = Sender(Allowed.of(allow), tls=tls, seconds=seconds)
    return asyncio.run(sender.send(url, {"webhook-id": "1", "content-type": "application/json"}, BODY))


def test_a_message_arrives_as_it_was_sent(receiver: Receiver) -> None:
    attempt = send(receiver.url(path="/hook?a=b"))
    assert (attempt.status, attempt.error) == (200, None)
    (request,) = receiver.received
    assert (request.path, request.body) == ("/hook?a=b", BODY)
    assert (request.id, request.headers["content-type"]) == ("1", "application/json")
    assert request.headers["host"] == f"127.0.0.1:{receiver.port}"


@pytest.mark.parametrize("code", [400, 404, 410, 429, 500, 503])
def test_any_other_answer_than_2xx_is_no_delivery(receiver: Receiver, code: int) -> None:
    receiver.answer = status(code, body=b"why")
    attempt = send(receiver.url())
    assert (attempt.status, attempt.error) == (code, f"answered {code}")


def test_a_redirect_is_not_followed(receiver: Receiver) -> None:
    with Receiver() as other:
        for code in (301, 302, 303, 307, 308):
            receiver.answer = status(code, location=other.url())
            attempt = send(receiver.url())
            assert (attempt.status, attempt.error) == (code, f"answered {code}, and redirects are not followed")
        assert other.received == []
    assert len(receiver.received) == 5


@pytest.mark.parametrize("answer", [hang, drip])
def test_a_receiver_that_hangs_is_left_when_the_time_is_over(receiver: Receiver, answer: object) -> None:
    receiver.answer = answer  # type: ignore[assignment]
    attempt = send(receiver.url(), seconds=0.5)
    assert (attempt.status, attempt.error) == (None, "no answer within 0.5 s")


@pytest.mark.parametrize("answer", [endless, stalling, status(200, body=bytes(5 * 2**20))])
def test_the_status_counts_and_a_body_is_left_that_is_long_or_does_not_come(receiver: Receiver, answer: object) -> None:
    receiver.answer = answer  # type: ignore[assignment]
    attempt = send(receiver.url(), seconds=30)
    assert (attempt.status, attempt.error) == (200, None)
    assert (
        receiver.written <= 32 * 2**20
    )  # what sockets hold; `endless` writes gigabytes for as long as the client reads


def test_an_answer_that_is_no_http_is_told_as_such(receiver: Receiver) -> None:
    receiver.answer = lambda _receiver, handler, _request: handler.wfile.write(b"220 smtp.example ESMTP\r\n")
    attempt = send(receiver.url())
    assert attempt.status is None
    assert attempt.error == "it cannot be reached: RemoteProtocolError"


def test_nobody_listening_is_told_without_an_address() -> None:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        attempt = send(f"http://127.0.0.1:{probe.getsockname()[1]}/")
    assert (attempt.status, attempt.error) == (None, "it cannot be reached: Connection refused")


def test_an_address_that_may_not_be_told_is_not_even_connected_to(receiver: Receiver) -> None:
    for host in ("127.0.0.1", "localhost", "2130706433", "[::ffff:127.0.0.1]"):
        attempt = send(receiver.url(host), ["public"])
        assert (attempt.status, attempt.error) == (None, "the webhook host resolves to a private address")
    assert send("https://no-such-host.invalid/").error == "the host is unknown"
    assert receiver.received == []


def test_a_name_is_looked_up_once_and_the_address_that_was_checked_is_the_one_connected_to(
    receiver: Receiver, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A name whose next answer leads elsewhere (DNS rebinding) gains nothing."""
    answers = ["127.0.0.1", "10.0.0.1"]
    real = socket.getaddrinfo

    def lookup(host: str, *arguments: object, **more: object) -> object:
        return real(answers.pop(0) if host == "rebinding.example" else host, *arguments, **more)  # type: ignore[arg-type]

    monkeypatch.setattr(socket, "getaddrinfo", lookup)
    assert send(receiver.url("rebinding.example")).error is None
    assert answers == ["10.0.0.1"]
    assert receiver.received[0].headers["host"] == f"rebinding.example:{receiver.port}"


def test_over_tls_the_name_is_asked_for_and_its_certificate_checked(authority: Authority) -> None:
    server = authority.server("localhost")
    asked: list[str | None] = []
    server.sni_callback = lambda _socket, name, _context: asked.append(name)  # type: ignore[assignment]
    with Receiver(tls=server) as receiver:
        attempt = send(receiver.url("localhost"), tls=authority.trusting())
        assert (attempt.status, attempt.error) == (200, None)
        assert asked == ["localhost"]
        assert receiver.received[0].headers["host"] == f"localhost:{receiver.port}"
        for url, tls in (
            (receiver.url("127.0.0.1"), authority.trusting()),  # the certificate is for the name alone
            (receiver.url("localhost"), None),  # that authority is unknown here
        ):
            attempt = send(url, tls=tls)
            assert attempt.status is None
            assert "its certificate is not valid" in (attempt.error or "")
        assert len(receiver.received) == 1
    with Receiver(tls=authority.server("elsewhere.example")) as receiver:
        assert "its certificate is not valid" in (send(receiver.url("localhost"), tls=authority.trusting()).error or "")
        assert receiver.received == []


def test_a_proxy_of_the_environment_is_not_used(receiver: Receiver, monkeypatch: pytest.MonkeyPatch) -> None:
    with Receiver() as proxy:
        for name in ("HTTP_PROXY", "http_proxy", "ALL_PROXY"):
            monkeypatch.setenv(name, proxy.url(path=""))
        assert send(receiver.url()).error is None
        assert proxy.received == []


def test_the_machine_s_own_authorities_are_named_by_the_usual_variable(
    authority: Authority, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SSL_CERT_FILE", str(authority.file))
    with Receiver(tls=authority.server("localhost")) as receiver:
        assert send(receiver.url("localhost")).error is None
