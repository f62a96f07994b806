"""Content of a socket: frames, for any speed of the client, and the state of the stream."""

from __future__ import annotations

import time

import httpx2
import pytest
import redis

from marey.api.streams import protocol
from marey.core.settings import Settings
from marey.motion.skeleton import HUMANML3D
from marey.streams import StreamState
from marey.streams.control import StreamControl
from marey.streams.presence import ViewerPresence
from marey.streams.rewrites import PromptRewrite
from tests.support.live_api import ApiThread, LiveApi
from tests.support.live_streams import Hand, watching
from tests.support.streams_api import LATE, WALK, begin, beside, until

# --- frames ---


def test_frames_arrive_byte_for_byte_and_in_order(api: LiveApi, stream: str, secret: str, hand: Hand) -> None:
    shown = hand.show(3)
    with watching(api.url, stream, secret) as viewer:
        first = viewer.until_frame(2)
        assert [message["type"] for message in first.messages] == ["stream"]
        shown += hand.show(1)
        shown += hand.show(60)
        assert first.frames + viewer.until_frame(63).frames == shown


def test_a_client_that_comes_back_goes_on_behind_its_last_frame(
    config: Settings, api: LiveApi, stream: str, secret: str, hand: Hand
) -> None:
    shown = hand.show(30)
    with watching(api.url, stream, secret) as viewer:
        seen = viewer.until_frame(9)
    shown += hand.show(30)
    with ApiThread(beside(config)) as other, watching(other, f"{stream}?from={seen.numbers[-1] + 1}", secret) as viewer:
        again = viewer.until_frame(59)
    assert seen.frames + again.frames == shown
    assert again.of("gap") == []


def test_a_client_may_wait_for_a_frame_that_comes_later(api: LiveApi, stream: str, secret: str, hand: Hand) -> None:
    with watching(api.url, f"{stream}?from=25", secret) as viewer:
        viewer.until("stream")
        shown = hand.show(30)
        assert viewer.until_frame(29).frames == shown[25:]


def test_frames_that_are_no_more_are_told_as_a_gap(api: LiveApi, stream: str, secret: str, hand: Hand) -> None:
    shown = [frame for _ in range(13) for frame in hand.show(100)]
    with watching(api.url, f"{stream}?from=40", secret) as viewer:
        seen = viewer.until_frame(1299)
    assert seen.of("gap") == [{"type": "gap", "first": 40, "count": 60}]
    assert seen.numbers == list(range(100, 1300))
    assert seen.frames == shown[100:]


def test_a_slow_client_skips_to_the_newest_frame_and_another_gets_every_one(
    api: LiveApi, stream: str, secret: str, hand: Hand
) -> None:
    with watching(api.url, stream, secret, narrow=True) as slow, watching(api.url, stream, secret) as quick:
        hand.show(5)
        slow.until_frame(4)
        for _ in range(LATE // 100):
            hand.show(100)
        assert quick.until_frame(LATE + 4).numbers == list(range(LATE + 5))
        time.sleep(1)  # our send to the slow one blocks
        seen = slow.until_frame(LATE + 4)
    missed = [gap["first"] + i for gap in seen.of("gap") for i in range(gap["count"])]
    assert seen.numbers == [number for number in range(5, LATE + 5) if number not in missed]
    assert missed[0] < LATE // 2, "too much was on its way to a client that took nothing"


def test_a_client_that_catches_up_slowly_loses_nothing(api: LiveApi, stream: str, secret: str, hand: Hand) -> None:
    for _ in range(LATE // 100):
        hand.show(100)
    with watching(api.url, stream, secret, narrow=True) as viewer:
        seen = viewer.until_frame(50)
        time.sleep(0.5)  # our send blocks, and no new frame comes
        seen.frames += viewer.until_frame(LATE - 1).frames
    assert seen.numbers == list(range(LATE))
    assert seen.of("gap") == []


def test_for_a_slow_client_that_wants_every_frame_the_stream_is_paused_until_it_has_them(
    api: LiveApi, stream: str, secret: str, hand: Hand
) -> None:
    with watching(api.url, f"{stream}?slow=pause", secret, narrow=True) as slow:
        hand.show(5)
        slow.until_frame(4)
        for _ in range(LATE // 100):
            hand.show(100)
        assert hand.received() == [StreamControl("pause")]
        hand.note(state=StreamState.PAUSED)
        assert slow.until_frame(LATE + 4).numbers == list(range(5, LATE + 5))
        assert hand.received() == [StreamControl("resume")]


def test_a_client_that_goes_away_leaves_no_stream_paused(api: LiveApi, stream: str, secret: str, hand: Hand) -> None:
    with watching(api.url, f"{stream}?slow=pause", secret, narrow=True) as slow:
        hand.show(5)
        slow.until_frame(4)
        for _ in range(LATE // 100):
            hand.show(100)
        assert hand.received() == [StreamControl("pause")]
        slow.connection.socket.close()
    assert hand.received() == [StreamControl("resume")]


def test_a_client_that_takes_nothing_any_more_is_let_go(
    config: Settings, stream: str, secret: str, hand: Hand, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(protocol, "PING_SECONDS", 1.0)
    monkeypatch.setattr(protocol, "PONG_SECONDS", 3.0)
    monkeypatch.setattr(protocol, "FLUSH_SECONDS", 0.1)
    with ApiThread(beside(config)) as url, watching(url, f"{stream}?slow=pause", secret, narrow=True) as dead:
        hand.show(5)
        dead.until_frame(4)
        for _ in range(LATE // 100):
            hand.show(100)
        assert hand.received() == [StreamControl("pause")]
        received: list[StreamControl] = []
        until(lambda: received or received.extend(hand.received()))
        assert received == [StreamControl("resume")]


def test_a_stream_is_watched_as_long_as_a_socket_is_open(
    api: LiveApi, stream: str, secret: str, client: redis.Redis
) -> None:
    presence = ViewerPresence(client, stream)
    assert not presence.is_active()
    with watching(api.url, stream, secret) as viewer:
        until(presence.is_active)
        client.delete(presence.key)
        until(presence.is_active)
        viewer.until("stream")


# --- how a stream stands ---


def test_a_client_is_told_when_a_worker_takes_the_stream_and_of_each_new_prompt(
    api: LiveApi, stream: str, secret: str, client: redis.Redis
) -> None:
    with watching(api.url, stream, secret) as viewer:
        assert viewer.until("stream").messages[0]["stream"]["state"] == "waiting"
        hand = Hand(api.engine, client, stream)
        assert viewer.until("stream").messages[0]["stream"]["state"] == "live"
        hand.show(20)
        hand.note((0, WALK["prompt"]))
        hand.show(10, prompt=1)
        hand.note((20, "a person jumps"), reads=[PromptRewrite("a person leaps")])
        told = viewer.until("stream").of("stream")[-1]["stream"]
        while len(told["prompts"]) < 2:
            told = viewer.until("stream").of("stream")[-1]["stream"]
    assert told["prompts"] == [
        {"number": 0, "frame": 0, "prompt": "a person walks", "rewritten": None, "not_rewritten": None, "warnings": []},
        {
            "number": 1,
            "frame": 20,
            "prompt": "a person jumps",
            "rewritten": "a person leaps",
            "not_rewritten": None,
            "warnings": [],
        },
    ]
    assert told["skeleton"]["names"][0] == HUMANML3D.joint_names[0]


def test_a_client_that_waits_is_told_when_its_place_in_the_queue_changes(
    api: LiveApi, http: httpx2.Client, stream: str, secret: str, client: redis.Redis
) -> None:
    second = begin(http)["id"]
    with watching(api.url, second, secret) as viewer:
        before = viewer.until("stream").messages[0]["stream"]["position"]
        assert before >= 1
        Hand(api.engine, client, stream)
        assert viewer.until("stream").messages[0]["stream"]["position"] == before - 1
    http.delete(f"/v1/streams/{second}")


def test_the_end_is_told_after_the_last_frame(api: LiveApi, stream: str, secret: str, hand: Hand) -> None:
    with watching(api.url, stream, secret) as viewer:
        shown = hand.show(45, last=True)
        seen = viewer.until_frame(44)
        hand.note((0, WALK["prompt"]))
        hand.end("max_frames")
        seen.messages += (end := viewer.until("end")).messages
        assert viewer.closed()[0] == 1000
    assert seen.frames + end.frames == shown
    (told,) = seen.of("end")
    assert (told["stream"]["state"], told["stream"]["reason"], told["stream"]["frames"]) == ("ended", "max_frames", 45)
    assert seen.messages[-1] == told


def test_a_stream_that_ends_without_a_last_frame_is_told_with_the_rest_of_its_frames(
    api: LiveApi, stream: str, secret: str, hand: Hand
) -> None:
    shown = hand.show(45)
    hand.end("lost")
    with watching(api.url, f"{stream}?from=5", secret) as viewer:
        seen = viewer.until("end")
        assert viewer.closed()[0] == 1000
    assert seen.frames == shown[5:]


def test_of_a_stream_that_is_long_over_the_gap_and_the_end_are_told(
    api: LiveApi, stream: str, secret: str, hand: Hand
) -> None:
    hand.show(45)
    hand.note((0, WALK["prompt"]))
    hand.end()
    hand.frames.drop()
    with watching(api.url, stream, secret) as viewer:
        seen = viewer.until("end")
    assert [message["type"] for message in seen.messages] == ["stream", "gap", "end"]
    assert seen.of("gap") == [{"type": "gap", "first": 0, "count": 45}]
