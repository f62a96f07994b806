"""`deploy/nginx/marey.conf` with the nginx of this machine, and what clients say where a line of it is missing."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from urllib.parse import urlsplit

import httpx2
import pytest

from marey.client import retries
from marey.client.server_address import Server
from marey.client.stream_socket import Link
from marey.client.transport import Transport
from marey.core.errors import InvalidInput, TooLarge, Unauthenticated, Unreachable
from tests.servers.nginx import PROGRAM, Nginx
from tests.servers.ports import free_ports
from tests.servers.receiver import Authority
from tests.servers.swift import Swift
from tests.support.live_api import LiveApi
from tests.support.live_streams import Hand
from tests.support.proxied import receive_until_refused, submit_watch_and_fetch, watch_a_stream

pytestmark = pytest.mark.skipif(PROGRAM is None, reason="nginx is not installed")

Without = Callable[[str], Nginx]


@pytest.fixture(autouse=True)
def _trusted(authority: Authority, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MAREY_CA_FILE", str(authority.file))


@pytest.fixture(scope="module")
def nginx(
    api: LiveApi, swift: Swift, authority: Authority, public_store: int, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Nginx]:
    folder = tmp_path_factory.mktemp("nginx") / "whole"
    with Nginx(folder, authority, api=urlsplit(api.url).netloc, store=swift.endpoint, store_port=public_store) as nginx:
        yield nginx


@pytest.fixture
def without(api: LiveApi, swift: Swift, authority: Authority, tmp_path: Path) -> Iterator[Without]:
    """An nginx whose configuration lacks the lines that match."""
    started: list[Nginx] = []

    def start(lines: str) -> Nginx:
        def edit(text: str) -> str:
            kept, count = re.subn(rf"^.*({lines}).*\n", "", text, flags=re.MULTILINE)
            assert count
            return kept

        folder = tmp_path / f"nginx-{len(started)}"
        nginx = Nginx(folder, authority, api=urlsplit(api.url).netloc, store=swift.endpoint, edit=edit)
        started.append(nginx)
        return nginx.__enter__()

    yield start
    for nginx in started:
        nginx.__exit__()


def test_jobs_events_and_files_pass(nginx: Nginx, api: LiveApi, tmp_path: Path) -> None:
    times = submit_watch_and_fetch(nginx.url, api, tmp_path)
    assert times[-1] - times[0] > 0.4, "events came all at once: something held them back"


def test_live_streams_pass(nginx: Nginx, api: LiveApi, hand: Hand) -> None:
    watch_a_stream(nginx.url, api, hand)


def test_a_body_of_more_than_nginx_takes_by_default_passes(nginx: Nginx, api: LiveApi) -> None:
    with Transport(Server(nginx.url, api.key)) as client:
        found = client.submit(({"prompt": f"a person walks {n} steps"} for n in range(40_000)), validate_only=True)
    assert found["items"] == 40_000


def test_a_name_that_is_not_allowed_is_refused_by_the_api(nginx: Nginx, api: LiveApi, authority: Authority) -> None:
    with httpx2.Client(verify=authority.trusting(), base_url=nginx.url) as http:
        answer = http.get("/livez", headers={"Host": "other.example.com"})
        assert (answer.status_code, answer.json()["type"]) == (403, "urn:marey:problem:refused")
        moved = http.get("/v1/jobs/", headers={"Authorization": f"Bearer {api.key}"})
        assert moved.headers.get("location", nginx.url).startswith(nginx.url)  # of the public scheme


def test_plain_http_is_led_to_https(nginx: Nginx, api: LiveApi) -> None:
    server = Server(f"http://localhost:{nginx.http_port}", api.key)
    with Transport(server) as client, pytest.raises(InvalidInput, match="a redirect to https://localhost\n"):
        client.get("/v1/jobs")
    with (
        Transport(Server(nginx.url.replace("https", "http"), api.key)) as client,
        pytest.raises(InvalidInput, match="Begin MAREY_SERVER with https"),
    ):
        client.get("/v1/jobs")


def test_only_fetching_passes_to_the_store(nginx: Nginx, authority: Authority) -> None:
    with httpx2.Client(verify=authority.trusting()) as http:
        assert http.put(f"https://localhost:{nginx.store_port}/marey/x", content=b"x").status_code == 403
        with pytest.raises(Unauthenticated), Transport(Server(nginx.url, "wrong")) as client:
            client.get("/v1/jobs")


def test_without_the_size_a_large_body_is_told_with_what_to_set(without: Without, api: LiveApi) -> None:
    nginx = without("client_max_body_size")
    with Transport(Server(nginx.url, api.key)) as client, pytest.raises(TooLarge, match="client_max_body_size 64m"):
        client.submit({"prompt": f"a person walks {n} steps"} for n in range(40_000))


def test_without_the_upgrade_a_stream_is_told_with_what_to_set(
    without: Without, api: LiveApi, hand: Hand, authority: Authority
) -> None:
    nginx = without("Upgrade|Connection")
    with (
        Link(Server(nginx.url, api.key), str(hand.stream)) as link,
        pytest.raises(InvalidInput, match="a proxy does not forward the upgrade"),
    ):
        link.receive(5)
    handshake = {"Connection": "Upgrade", "Upgrade": "websocket", "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ=="}
    with httpx2.Client(verify=authority.trusting(), base_url=nginx.url) as http:
        answer = http.get(f"/v1/streams/{hand.stream}", headers={**handshake, "Sec-WebSocket-Version": "13"})
    assert (answer.status_code, answer.json()["type"]) == (426, "urn:marey:problem:upgrade-missing")


def test_an_api_that_is_away_is_unreachable(
    swift: Swift, authority: Authority, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(retries, "FIRST_PAUSE", 0.01)
    nobody = f"127.0.0.1:{free_ports(1)[0]}"
    with Nginx(tmp_path / "nginx", authority, api=nobody, store=swift.endpoint) as nginx:
        with Transport(Server(nginx.url, "key")) as client, pytest.raises(Unreachable, match="answered 502"):
            client.get("/v1/jobs")
        with Link(Server(nginx.url, "key"), "x", patience=0.2) as link, pytest.raises(Unreachable, match="HTTP 502"):
            receive_until_refused(link)
