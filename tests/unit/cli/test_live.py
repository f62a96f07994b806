"""Parts of `marey stream`."""

from __future__ import annotations

import socket
import struct
import time

import numpy as np
import pytest

from marey.cli.live.pace import Pace
from marey.cli.live.steering import Command, command_of
from marey.client import stream_socket
from marey.client.server_address import Server
from marey.client.stream_socket import Link
from marey.core.errors import InvalidInput, MareyError, NotFound, Refused, Unauthenticated, Unreachable
from tests.support.stream_server import KEY, STREAM, Plan, StreamServer

IDENTITY = np.tile([1.0, 0, 0, 0], (22, 1))


# --- pace ---


def test_frames_that_come_evenly_are_not_late() -> None:
    pace = Pace(20)
    for number in range(100):
        pace.arrived(number, 7.0 + number / 20)
        assert pace.latency(7.0 + number / 20) == pytest.approx(0, abs=1e-9)
    assert pace.fps(7.0 + 99 / 20) == pytest.approx(20)
    assert pace.latency(7.0 + 99 / 20 + 0.03) == pytest.approx(0.03), "the newest frame ages until the next one"


def test_latency_is_what_was_lost_since_the_frame_that_came_earliest() -> None:
    pace = Pace(20)
    pace.arrived(0, 0.3)  # late itself
    pace.arrived(1, 0.1)
    pace.arrived(2, 0.4)
    assert pace.latency(0.4) == pytest.approx(0.25)


def test_a_stream_that_stalls_gets_slower_and_later() -> None:
    pace = Pace(20)
    for number in range(40):
        pace.arrived(number, number / 20)
    assert pace.latency(3.95) == pytest.approx(2.0)
    assert pace.fps(2.95) == pytest.approx(10, rel=0.1)
    assert pace.fps(60) == 0


def test_a_pause_is_no_latency() -> None:
    pace = Pace(20)
    assert pace.latency(1.0) is None
    pace.arrived(0, 0.0)
    pace.rest()
    assert pace.latency(50.0) is None
    pace.arrived(1, 100.0)
    assert pace.latency(100.0) == 0
    assert pace.fps(100.0) == 0


# --- what is typed ---


@pytest.mark.parametrize(
    ("line", "command"),
    [
        ("a person runs\r", Command("steer", "a person runs")),
        ("  a   person\truns ", Command("steer", "a person runs")),
        ("/pause", Command("pause")),
        (" /Resume ", Command("resume")),
        ("/stop", Command("stop")),
        ("", None),
        (" \t\r", None),
    ],
)
def test_a_line_is_a_steer_a_word_or_nothing(line: str, command: Command | None) -> None:
    assert command_of(line) == command


@pytest.mark.parametrize(
    ("line", "said"), [("/jump", "/pause, /resume, /stop"), ("走る", "English"), ("a\x07", "U+0007")]
)
def test_a_line_that_cannot_be_meant_is_not_sent(line: str, said: str) -> None:
    with pytest.raises(InvalidInput) as caught:
        command_of(line)
    assert said in str(caught.value)


# --- the socket ---


def watch(url: str, *, patience: float = 30.0, slow: str = "skip") -> tuple[list[int], list[str], Link]:
    """Receive to the end: numbers of the frames, types of the messages."""
    numbers: list[int] = []
    types: list[str] = []
    deadline = time.monotonic() + 60
    with Link(Server(url, KEY), STREAM, slow=slow, patience=patience) as link:
        while "end" not in types:
            assert time.monotonic() < deadline
            for message in link.receive(0.05):
                if isinstance(message, bytes):
                    numbers.append(struct.unpack_from("<I", message, 4)[0])
                    link.next = numbers[-1] + 1
                else:
                    types.append(message["type"])
    return numbers, types, link


def test_the_socket_says_who_we_are_and_what_we_want() -> None:
    with StreamServer(Plan(frames=3)) as server:
        server.begin({"prompt": "a person walks"})
        numbers, types, link = watch(server.url, slow="pause")
    (path, query, headers), *more = server.opened
    assert (numbers, types[0], link.sockets, more) == ([0, 1, 2], "stream", 1, [])
    assert path == f"/v1/streams/{STREAM}"
    assert query == {"from": "0", "slow": "pause"}
    assert headers["Authorization"] == f"Bearer {KEY}"
    assert headers["Sec-WebSocket-Protocol"] == "marey.stream.v1"


def test_a_socket_that_breaks_is_taken_up_behind_the_last_frame() -> None:
    with StreamServer(Plan(frames=30, drops={4, 17})) as server:
        server.begin({"prompt": "a person walks"})
        numbers, _, link = watch(server.url)
    assert numbers == list(range(30))
    assert [query["from"] for _, query, _ in server.opened] == ["0", "4", "17"]
    assert link.sockets == 3


def test_a_server_that_has_no_room_is_asked_again() -> None:
    with StreamServer(Plan(frames=3, closes=[(1013, "too many"), (1011, "")])) as server:
        server.begin({"prompt": "a person walks"})
        assert watch(server.url)[0] == [0, 1, 2]
    assert len(server.opened) == 3


@pytest.mark.parametrize(
    ("code", "error"), [(4401, Unauthenticated), (4403, Refused), (4404, NotFound), (4422, InvalidInput)]
)
def test_a_server_that_will_not_have_us_is_not_asked_again(code: int, error: type[MareyError]) -> None:
    with StreamServer(Plan(closes=[(code, "because")])) as server:
        server.begin({"prompt": "a person walks"})
        with pytest.raises(error, match="because"):
            watch(server.url)
    assert len(server.opened) == 1


def test_a_server_that_stays_away_is_unreachable(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stream_socket, "LONGEST_PAUSE", 0.1)
    with socket.create_server(("127.0.0.1", 0)) as probe:
        port = probe.getsockname()[1]
    with pytest.raises(Unreachable, match=r"out of reach for 1 s.*refused"):
        watch(f"http://127.0.0.1:{port}", patience=0.6)


def test_a_server_that_only_ever_closes_is_unreachable(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stream_socket, "LONGEST_PAUSE", 0.1)
    with StreamServer(Plan(closes=[(1013, "the database is away")] * 1000)) as server:
        server.begin({"prompt": "a person walks"})
        with pytest.raises(Unreachable, match="the database is away"):
            watch(server.url, patience=0.6)
    assert len(server.opened) > 2


@pytest.mark.parametrize("said", ["nonsense", "[1]", '{"stream": 1}'])
def test_a_server_that_speaks_otherwise_is_told_apart(said: str) -> None:
    with StreamServer(Plan(told=[said])) as server:
        server.begin({"prompt": "a person walks"})
        with pytest.raises(InvalidInput, match="is no message"):
            watch(server.url)


def test_an_address_with_tls_gives_a_socket_with_tls(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[str] = []

    def connect(address: str, **_: object) -> object:
        seen.append(address)
        raise OSError("no")

    monkeypatch.setattr(stream_socket, "connect", connect)
    with Link(Server("https://marey.example.com/motion", KEY), STREAM) as link:
        assert link.receive(0.01) == []
    assert seen == [f"wss://marey.example.com/motion/v1/streams/{STREAM}?from=0&slow=skip"]
