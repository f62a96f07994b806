"""Messages of a socket's client, and the fate of the socket when a server stops."""

from __future__ import annotations

import threading
from pathlib import Path

import httpx2
import pytest

from marey.api.streams import messages, session
from marey.core.settings import Settings
from marey.embedded import start_valkey
from marey.runtime.queue import redis_client
from marey.streams.control import StreamControl
from marey.streams.redis import FrameStream
from tests.support.live_api import ApiThread, LiveApi
from tests.support.live_streams import PATIENCE, Hand, watching
from tests.support.streams_api import begin, beside, new_key

# --- control ---


def test_what_a_client_asks_reaches_the_worker(api: LiveApi, stream: str, secret: str, hand: Hand) -> None:
    with watching(api.url, stream, secret) as viewer:
        viewer.ask("steer", prompt="  a person   jumps ")
        viewer.ask("pause")
        viewer.connection.send(b'{"kind": "resume"}')
        viewer.ask("stop")
        received: list[StreamControl] = []
        while len(received) < 4:
            received += hand.received()
    assert received == [
        StreamControl("steer", "a person jumps"),
        StreamControl("pause"),
        StreamControl("resume"),
        StreamControl("stop"),
    ]


def test_a_stop_of_a_stream_that_waits_ends_it(api: LiveApi, stream: str, secret: str) -> None:
    with watching(api.url, stream, secret) as viewer:
        viewer.ask("stop")
        assert viewer.until("end").of("end")[0]["stream"]["reason"] == "stopped"
        assert viewer.closed()[0] == 1000


@pytest.mark.parametrize(
    ("message", "kind"),
    [
        ("", "invalid-input"),
        ("{", "invalid-input"),
        (b"\xff\x00", "invalid-input"),
        ("[" * 8000, "invalid-input"),
        ("[]", "invalid-input"),
        ('{"kind": "fly"}', "invalid-input"),
        ('{"kind": "pause", "prompt": "a person jumps"}', "invalid-input"),
        ('{"kind": "steer"}', "invalid-input"),
        ('{"kind": "steer", "prompt": "走る"}', "invalid-input"),
        ('{"kind": "steer", "prompt": "\\ud800"}', "invalid-input"),
        ('{"kind": "steer", "prompt": "' + "walks " * 2000 + '"}', "too-large"),
    ],
)
def test_a_message_that_cannot_be_used_is_told_and_the_socket_stays(
    api: LiveApi, stream: str, secret: str, hand: Hand, message: str | bytes, kind: str
) -> None:
    with watching(api.url, stream, secret) as viewer:
        viewer.connection.send(message)
        problem = viewer.until("error").of("error")[0]["problem"]
        assert problem["type"] == f"urn:marey:problem:{kind}"
        assert problem["detail"]
        viewer.ask("pause")
        assert hand.received() == [StreamControl("pause")]


def test_a_message_that_is_far_too_long_closes_the_socket(api: LiveApi, stream: str, secret: str) -> None:
    with watching(api.url, stream, secret) as viewer:
        viewer.until("stream")
        viewer.connection.send("x" * 70_000)
        assert viewer.closed()[0] == 1009


def test_too_many_messages_at_once_are_told(
    api: LiveApi, stream: str, secret: str, hand: Hand, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(messages, "A_SECOND", 1)  # a busy machine may not obey twenty
    with watching(api.url, stream, secret) as viewer:
        for _ in range(300):
            viewer.ask("pause")
        assert viewer.until("error").of("error")[0]["problem"]["type"] == "urn:marey:problem:busy"
    assert len(hand.received()) >= 1


def test_who_may_only_look_asks_in_vain(api: LiveApi, stream: str, hand: Hand) -> None:
    with watching(api.url, stream, new_key(api, "read")) as viewer:
        shown = hand.show(1)
        viewer.ask("stop")
        seen = viewer.until("error")
        assert seen.of("error")[0]["problem"]["type"] == "urn:marey:problem:refused"
        assert (seen.frames or viewer.until_frame(0).frames) == shown


def test_a_message_to_a_stream_that_is_over_is_an_error(
    api: LiveApi, stream: str, secret: str, hand: Hand, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(session, "IDLE_SECONDS", 4.0)  # the socket does not know it yet
    with watching(api.url, stream, secret) as viewer:
        viewer.until("stream")
        hand.end()
        for kind in ("pause", "stop"):
            viewer.ask(kind)
            problem = viewer.until("error").of("error")[0]["problem"]
            assert problem["type"] == "urn:marey:problem:conflict"
        viewer.until("end")


# --- outages, and the end of the server ---


def test_a_socket_outlives_a_restart_of_redis(
    config: Settings, api: LiveApi, http: httpx2.Client, secret: str, short_home: Path
) -> None:
    server = start_valkey(short_home)
    stream = begin(http)["id"]
    with ApiThread(beside(config, streams_url=server.url)) as url, watching(url, stream, secret) as viewer:
        with redis_client(server.url) as own:
            shown = Hand(api.engine, own, stream).show(3)
        assert viewer.until_frame(2).frames == shown
        server.stop()
        problem = viewer.until("error").of("error")[0]["problem"]
        assert problem["type"] == "urn:marey:problem:unreachable"
        with start_valkey(short_home) as again, redis_client(again.url) as own:
            frames = FrameStream(own, stream, lease_ms=600_000)
            frames.drop()
            own.xadd(frames.frames_key, {"f": shown[2]}, id="9-0")
            seen = viewer.until_frame(2)
            assert seen.of("gap") == [{"type": "gap", "first": 3, "count": 5}]
            assert seen.of("error") == []


def test_a_redis_that_stays_away_closes_the_socket_until_later(
    config: Settings, stream: str, secret: str, short_home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(session, "OUTAGE_SECONDS", 0.7)
    server = start_valkey(short_home)
    with ApiThread(beside(config, streams_url=server.url)) as url, watching(url, stream, secret) as viewer:
        viewer.until("stream")
        server.stop()
        viewer.until("error")
        code, reason = viewer.closed()
    assert code == 1013
    assert reason == "the frames of live streams cannot be reached"


def test_a_server_that_stops_ends_its_sockets(config: Settings, stream: str, secret: str, hand: Hand) -> None:
    hand.show(3)
    server = ApiThread(beside(config))
    with server as url, watching(url, stream, secret) as viewer:
        viewer.until_frame(2)
        stopping = threading.Thread(target=server.__exit__)
        stopping.start()
        assert viewer.closed()[0] == 1012
        stopping.join(PATIENCE)
        assert not stopping.is_alive()
