"""A client and a server behind certificates of a studio's own authority: HTTP, events, sockets and downloads."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from marey.client.server_address import Server
from marey.client.stream_socket import Link
from marey.client.transport import Transport
from marey.core.errors import Unreachable
from marey.core.settings import Settings
from tests.servers.receiver import Authority
from tests.servers.swift import Swift
from tests.servers.tls_front import TlsFront
from tests.support.live_api import LiveApi
from tests.support.live_streams import Hand
from tests.support.marey import Marey
from tests.support.proxied import submit_watch_and_fetch, watch_a_stream

VARIABLES = ("MAREY_CA_FILE", "SSL_CERT_FILE")


@pytest.fixture(autouse=True)
def _none_is_trusted(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in (*VARIABLES, "SSL_CERT_DIR"):
        monkeypatch.delenv(name, raising=False)


@pytest.fixture(scope="module")
def front(api: LiveApi, authority: Authority) -> Iterator[TlsFront]:
    port = urlsplit(api.url).port
    assert port is not None
    with TlsFront(authority.server("localhost"), ("127.0.0.1", port)) as front:
        yield front


@pytest.fixture(scope="module")
def store_front(swift: Swift, authority: Authority, public_store: int) -> Iterator[TlsFront]:
    host, _, port = swift.endpoint.partition(":")
    with TlsFront(authority.server("localhost"), (host, int(port)), port=public_store) as front:
        yield front


@pytest.fixture
def url(front: TlsFront) -> str:
    return f"https://localhost:{front.port}"


@pytest.mark.parametrize("variable", VARIABLES)
def test_jobs_events_files_and_streams_work_with_it(
    variable: str,
    url: str,
    store_front: TlsFront,
    api: LiveApi,
    hand: Hand,
    authority: Authority,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv(variable, str(authority.file))
    downloads = store_front.connections
    submit_watch_and_fetch(url, api, tmp_path)
    assert store_front.connections > downloads
    watch_a_stream(url, api, hand)


def test_without_it_each_says_what_to_set_and_tries_once(url: str, front: TlsFront, api: LiveApi) -> None:
    began = time.monotonic()
    with Transport(Server(url, api.key)) as client:
        for call in (lambda: client.get("/v1/jobs"), lambda: list(client.events("x"))):
            with pytest.raises(Unreachable, match="certificate of the server is not trusted") as told:
                call()
            assert "MAREY_CA_FILE" in str(told.value)
            assert told.value.where == url
    with Link(Server(url, api.key), "x") as link, pytest.raises(Unreachable, match="is not trusted"):
        link.receive(1)
    assert time.monotonic() - began < 10
    assert front.connections >= 0


def test_a_store_that_is_not_trusted_is_named(
    api: LiveApi, config: Settings, store_front: TlsFront, tmp_path: Path
) -> None:
    with pytest.raises(Unreachable, match="is not trusted") as told:
        submit_watch_and_fetch(api.url, api, tmp_path)
    assert told.value.where == config.s3_public_endpoint


def test_another_name_than_that_of_the_certificate_is_refused(
    front: TlsFront, api: LiveApi, authority: Authority, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MAREY_CA_FILE", str(authority.file))
    url = f"https://127.0.0.1:{front.port}"
    with Transport(Server(url, api.key)) as client, pytest.raises(Unreachable, match=r"not trusted .*127\.0\.0\.1"):
        client.get("/v1/jobs")


def test_commands_take_it_from_the_environment(url: str, api: LiveApi, authority: Authority, tmp_path: Path) -> None:
    named = {"MAREY_SERVER": url, "MAREY_KEY": api.key}
    Marey(tmp_path, tmp_path / "none", named)("jobs", "list").refused(4, "is not trusted", "MAREY_CA_FILE")
    trusting = {**named, "MAREY_CA_FILE": str(authority.file)}
    Marey(tmp_path, tmp_path / "none", trusting)("jobs", "list").ok()
