"""Live streams of the typed client against a stand-in server: order, gaps, breaks, steering, recording."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from marey.client import Client, Conflict, FramesMissing, InvalidInput, ItemsFailed, StreamChanged, StreamProblem
from marey.client import frames as frames_module
from marey.client.frames import read_frame
from marey.client.streams import LiveStream
from marey.motion import read_bvh
from marey.streams.frames import Frame, decode_frame, encode_frame
from tests.support.motions import dancer
from tests.support.stream_server import KEY, Plan, StreamServer

Serve = Callable[..., tuple[StreamServer, LiveStream]]


@pytest.fixture
def serve() -> Iterator[Serve]:
    """A server with a plan, and its stream."""
    with contextlib.ExitStack() as stack:

        def start(**plan: object) -> tuple[StreamServer, LiveStream]:
            server = stack.enter_context(StreamServer(Plan(**plan)))  # type: ignore[arg-type]
            client = stack.enter_context(Client(server.url, KEY))
            live = client.streams.open("a person walks", seed=3)
            stack.callback(live.close)
            return server, live

        yield start


def test_frames_come_once_and_in_order_through_broken_connections(serve: Serve) -> None:
    server, live = serve(frames=30, drops={4, 11}, again=3)
    frames = list(live)
    assert [frame.number for frame in frames] == list(range(30))
    assert (live.stream.state, live.missing, frames[-1].last) == ("ended", 0, True)
    assert len(server.opened) == 3
    assert server.begun == [{"prompt": "a person walks", "seed": 3}]


def test_frames_that_are_not_sent_are_counted(serve: Serve) -> None:
    _, live = serve(frames=30, gaps={5: 3}, silent={20: 4})
    assert [frame.number for frame in live] == [n for n in range(30) if n not in {5, 6, 7, 20, 21, 22, 23}]
    assert live.missing == 7


def test_a_stream_that_fails_raises_after_its_last_frame(serve: Serve) -> None:
    _, live = serve(frames=30, fails=6)
    seen: list[int] = []
    with pytest.raises(ItemsFailed, match="the worker is out of memory"):
        seen.extend(frame.number for frame in live)
    assert live.stream.state == "failed"


def test_what_the_server_refuses_is_raised_and_iterating_goes_on(serve: Serve) -> None:
    refused = {"type": "urn:marey:problem:invalid-input", "title": "x", "status": 422, "detail": "no such word"}
    _, live = serve(frames=10, told=[json.dumps({"type": "error", "problem": refused})])
    with pytest.raises(InvalidInput, match="no such word"):
        list(live)
    assert [frame.number for frame in live][-1] == 9


def test_it_is_steered_and_stopped(serve: Serve) -> None:
    server, live = serve(frames=10_000, speed=100.0)
    for frame in live:
        if frame.number == 3:
            live.steer("a person waves")
        if frame.prompt == 1 and live.stream.state == "live":
            live.stop()
    assert [message["kind"] for message in server.messages][:2] == ["steer", "stop"]
    assert [prompt.prompt for prompt in live.stream.prompts] == ["a person walks", "a person waves"]
    with pytest.raises(InvalidInput):
        live.steer("")


def test_the_recording_has_a_row_for_each_frame(serve: Serve, tmp_path: Path) -> None:
    server, live = serve(frames=30, gaps={5: 3})
    live.record(tmp_path / "walk.bvh")
    frames = list(live)
    live.close()
    clip = read_bvh(tmp_path / "walk.bvh", rest_frame="keep")
    assert len(clip.root) == 30
    numbers = [frame.number for frame in frames]
    assert np.abs(clip.root[numbers] - server.root[numbers]).max() < 1e-4


def test_updates_are_received_one_by_one_without_iterating(serve: Serve) -> None:
    refused = {"type": "urn:marey:problem:invalid-input", "title": "x", "status": 422, "detail": "no such word"}
    _, live = serve(frames=12, gaps={5: 3}, drops={9}, told=[json.dumps({"type": "error", "problem": refused})])
    frames: list[int] = []
    missing: list[FramesMissing] = []
    problems: list[StreamProblem] = []
    states: list[str] = []
    while not live.has_ended:
        update = live.receive(0.05)
        if isinstance(update, frames_module.Frame):
            frames.append(update.number)
        elif isinstance(update, FramesMissing):
            missing.append(update)
        elif isinstance(update, StreamProblem):
            problems.append(update)
        elif isinstance(update, StreamChanged):
            states.append(update.stream.state)
    assert frames == [0, 1, 2, 3, 4, 8, 9, 10, 11]
    assert missing == [FramesMissing(first=5, count=3)]
    assert [(type(each.error), each.raw) for each in problems] == [(InvalidInput, refused)] * 2  # of each connection
    assert states[-1] == live.stream.state == "ended"
    assert (live.missing, live.buffered, live.connections, live.failure()) == (3, 0, 2, None)


def test_a_command_is_sent_without_waiting_where_there_is_a_connection(serve: Serve) -> None:
    server, live = serve(frames=10_000, speed=100.0)
    assert not live.connected
    assert not live.try_send("stop")
    while not live.connected:
        live.receive(0.05)
    assert live.try_send("steer", "a person waves")
    server.until(lambda: [message["kind"] for message in server.messages] == ["steer"])
    live.stop()
    list(live)
    assert live.stream.state == "ended"


def test_a_recording_is_checked_before_the_stream_begins(tmp_path: Path) -> None:
    (tmp_path / "walk.bvh").write_text("old")
    with StreamServer(Plan(frames=4)) as server, Client(server.url, KEY) as client:
        with pytest.raises(Conflict) as told:
            client.streams.open("a person walks", record=tmp_path / "walk.bvh")
        assert (told.value.argument, server.begun) == ("overwrite", [])
        with pytest.raises(InvalidInput, match=r"only a \.bvh"):
            client.streams.open("a person walks", record=tmp_path / "walk.npz")
        with client.streams.open("a person walks", record=tmp_path / "walk.bvh", overwrite=True) as live:
            assert live.recorded is None
            assert len(list(live)) == 4
        assert live.recorded == tmp_path / "walk.bvh"
    assert len(read_bvh(tmp_path / "walk.bvh", rest_frame="keep").root) == 4


def test_a_frame_is_read_as_the_server_reads_it() -> None:
    rotations, root = dancer(frames=8)
    for number in range(8):
        contacts = (number % 2 == 0, True, False, number > 3)
        data = encode_frame(Frame(number, root[number], rotations[number], contacts, 2, number == 7))
        ours, theirs = read_frame(data, joints=len(rotations[0])), decode_frame(data)
        assert (ours.number, ours.prompt, ours.contacts, ours.last) == (number, 2, contacts, number == 7)
        np.testing.assert_array_equal(np.array(ours.root, np.float32), theirs.root)
        np.testing.assert_array_equal(np.array(ours.rotations, np.float32), theirs.rotations)
        assert ours.data == data


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda d: d[:20], "a frame has at least"),
        (lambda d: b"XX" + d[2:], "not a frame of a Marey stream"),
        (lambda d: d[:2] + b"\x02" + d[3:], "version 2"),
        (lambda d: d[:3] + b"\x40" + d[4:], "flags 0x40"),
        (lambda d: d + b"\0", "bytes, not the 200 of 22 joints"),
        (lambda d: d[:12] + b"\0\0\xc0\x7f" + d[16:], "NaN"),
        (lambda d: d[:24] + bytes(8) + d[32:], "joint 0 has not length 1"),
    ],
)
def test_bytes_that_are_no_frame_are_refused(change: Callable[[bytes], bytes], said: str) -> None:
    rotations, root = dancer(frames=1)
    data = encode_frame(Frame(0, root[0], rotations[0]))
    read_frame(data, joints=22)
    for reader in (read_frame, decode_frame):
        with pytest.raises(InvalidInput, match=said):
            reader(change(data), joints=22)
    with pytest.raises(InvalidInput, match="22 joints, not 21"):
        read_frame(data, joints=21)
