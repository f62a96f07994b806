"""Permission to open the socket of a live stream."""

from __future__ import annotations

import json
import socket
from typing import Any
from uuid import uuid4

import httpx2
import pytest
from websockets.exceptions import InvalidStatus

from marey.api import stream_hub as hub
from marey.core.settings import Settings
from tests.support.live_api import ApiThread, LiveApi
from tests.support.live_streams import PATIENCE, watching
from tests.support.streams_api import WALK, beside, close_code, new_key, refused


def test_a_key_comes_by_header(api: LiveApi, stream: str, secret: str) -> None:
    with watching(api.url, stream, secret) as viewer:
        assert viewer.connection.subprotocol is None
        assert viewer.until("stream").messages[0]["stream"]["id"] == stream


def test_a_key_comes_by_subprotocol_from_a_page_of_this_host(api: LiveApi, stream: str, secret: str) -> None:
    offered = ["marey.stream.v1", f"marey.key.{secret}"]
    with watching(api.url, stream, None, subprotocols=offered, origin="http://localhost:3000") as viewer:
        assert viewer.connection.subprotocol == "marey.stream.v1"
        assert viewer.until("stream").messages[0]["stream"]["id"] == stream


def test_a_key_is_never_logged(api: LiveApi, stream: str, secret: str, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level("DEBUG", logger="uvicorn.error")
    with watching(api.url, stream, None, subprotocols=[f"marey.key.{secret}"]) as viewer:
        viewer.until("stream")
    lines = [record.getMessage() for record in caplog.records if record.name == "uvicorn.error"]
    assert any("accepted" in line for line in lines)
    assert not [line for line in lines if secret in line]


def test_a_socket_that_cannot_be_opened_is_closed_with_a_code_that_says_why(
    api: LiveApi, stream: str, secret: str
) -> None:
    assert close_code(api, stream, None) == 4401
    assert close_code(api, stream, None, subprotocols=["marey.stream.v1"]) == 4401
    assert close_code(api, stream, "marey_x_y") == 4401
    assert close_code(api, stream, new_key(api, "submit")) == 4403
    assert close_code(api, str(uuid4()), secret) == 4404
    assert close_code(api, "nothing", secret) == 4404
    for query in (
        "from=-1",
        "from=x",
        "from=1.5",
        "from=4294967296",
        "from=１",
        "slow=stop",
        "slow=",
        "form=5",
        "from=1&from=2",
    ):
        assert close_code(api, f"{stream}?{query}", secret) == 4422, query


def test_pausing_for_a_slow_client_wants_submit(api: LiveApi, stream: str) -> None:
    assert close_code(api, f"{stream}?slow=pause", new_key(api, "read")) == 4403


@pytest.mark.parametrize(
    "options",
    [
        {"host": "evil.example"},
        {"host": "[::2]"},
        {"origin": "http://evil.example"},
        {"origin": "null"},
        {"origin": "http://127.0.0.1.evil.example"},
        {"origin": "http://127.0.0.1@evil.example"},
        {"origin": "http://["},
    ],
)
def test_a_foreign_host_or_origin_opens_no_socket(
    api: LiveApi, stream: str, secret: str, options: dict[str, Any]
) -> None:
    with pytest.raises(InvalidStatus) as error, watching(api.url, stream, secret, **options):
        pass
    assert error.value.response.status_code == 403
    assert json.loads(error.value.response.body)["type"] == "urn:marey:problem:refused"


def test_one_socket_too_many_is_asked_to_come_later(
    config: Settings, stream: str, secret: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(hub, "SOCKETS", 1)
    with ApiThread(beside(config)) as url:
        with watching(url, stream, secret) as viewer:
            viewer.until("stream")
            with watching(url, stream, secret) as second:
                assert second.closed()[0] == 1013
        while True:  # the place is free as soon as the server has seen that the client went
            with watching(url, stream, secret) as third:
                if json.loads(third.connection.recv(timeout=PATIENCE))["type"] == "stream":
                    break


def test_a_key_has_a_share_of_the_sockets_and_leaves_the_rest_to_others(
    config: Settings, api: LiveApi, stream: str, secret: str
) -> None:
    other = new_key(api, "read")
    with ApiThread(beside(config, sockets_per_key=1)) as url:
        with watching(url, stream, secret) as viewer:
            viewer.until("stream")
            with watching(url, stream, secret) as second:
                code, reason = second.closed()
                assert (code, reason) == (1013, "this key has 1 sockets open, its limit")
            with watching(url, stream, other) as third:
                third.until("stream")
            viewer.connection.socket.shutdown(socket.SHUT_RDWR)  # it does not say goodbye
        while True:
            with watching(url, stream, secret) as again:
                if json.loads(again.connection.recv(timeout=PATIENCE))["type"] == "stream":
                    break


def test_without_redis_streams_say_so_and_the_rest_works(config: Settings, stream: str, secret: str) -> None:
    headers = {"Authorization": f"Bearer {secret}"}
    with ApiThread(beside(config, queue_url=None)) as url, httpx2.Client(base_url=url, headers=headers) as http:
        for response in (http.post("/v1/streams", json=WALK), http.delete(f"/v1/streams/{stream}")):
            assert refused(response, 503, "unreachable")["detail"] == "this server has no live streams"
        assert http.get(f"/v1/streams/{stream}").status_code == 200
        assert http.post("/v1/jobs", json={"items": [{**WALK, "model": "hgm3"}]}).status_code == 202
        with watching(url, stream, secret) as viewer:
            assert viewer.closed() == (1013, "this server has no live streams")
