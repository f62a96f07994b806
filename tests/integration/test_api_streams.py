"""Live streams over HTTP and WebSocket: a real uvicorn, Postgres and Valkey, and hands for a worker's live loop."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from uuid import UUID, uuid4

import httpx2
import numpy as np
import pytest
import redis
import sqlalchemy as sa
from websockets.exceptions import InvalidStatus

from services.api.streams import hub, session
from shared.jobs import StreamState, create_key, schema, take_stream, transaction
from shared.motion.skeleton import HUMANML3D
from shared.runtime.embedded import EmbeddedServer, start_valkey
from shared.runtime.queue import redis_client
from shared.settings import Settings
from shared.streams.control import Control, ControlQueue
from shared.streams.redis import FrameStream
from shared.streams.watch import Watch
from tests.support.live_api import ApiThread, LiveApi, running_api, settings_of
from tests.support.live_streams import BUNDLE, PATIENCE, Hand, add_mogo, watching

WALK = {"prompt": "a person walks"}
LATE = 600
"""Frames that no buffer between us and a client that reads nothing can hold, and that Redis still has."""


@pytest.fixture(scope="module")
def config(module_database_url: str, valkey: EmbeddedServer, tmp_path_factory: pytest.TempPathFactory) -> Settings:
    config = settings_of(tmp_path_factory.mktemp("streams"), module_database_url, valkey.url)
    add_mogo(config)
    return config


@pytest.fixture(scope="module")
def api(config: Settings, module_database_url: str) -> Iterator[LiveApi]:
    with running_api(config, module_database_url) as api:
        yield api


@pytest.fixture
def client(valkey: EmbeddedServer) -> Iterator[redis.Redis]:
    with redis_client(valkey.url) as client:
        yield client


@pytest.fixture
def secret(api: LiveApi) -> str:
    """A key of the test's own, for how many streams one may have."""
    return new_key(api, "read", "submit")


@pytest.fixture
def http(api: LiveApi, secret: str) -> Iterator[httpx2.Client]:
    with httpx2.Client(base_url=api.url, headers={"Authorization": f"Bearer {secret}"}, timeout=PATIENCE) as client:
        yield client


@pytest.fixture
def stream(http: httpx2.Client) -> Iterator[str]:
    """A stream that waits."""
    identifier = begin(http)["id"]
    yield identifier
    http.delete(f"/v1/streams/{identifier}")


@pytest.fixture
def hand(api: LiveApi, client: redis.Redis, stream: str) -> Hand:
    """What makes it."""
    return Hand(api.engine, client, stream)


def new_key(api: LiveApi, *scopes: str, tenant: str = "default") -> str:
    with transaction(api.engine) as conn:
        return create_key(conn, "one", scopes, tenant=tenant).secret


def begin(http: httpx2.Client, **fields: object) -> dict[str, Any]:
    response = http.post("/v1/streams", json={**WALK, **fields})
    assert response.status_code == 201, response.text
    return response.json()


def refused(response: httpx2.Response, status: int, kind: str) -> dict[str, Any]:
    assert response.status_code == status, response.text
    assert response.json()["type"] == f"urn:marey:problem:{kind}"
    return response.json()


def close_code(api: LiveApi, stream: str, secret: str | None, **options: Any) -> int:
    with watching(api.url, stream, secret, **options) as viewer:
        return viewer.closed()[0]


# --- over HTTP ---


def test_a_stream_begins_waiting_with_exact_bundle_drawn_seed_and_skeleton(http: httpx2.Client) -> None:
    response = http.post("/v1/streams", json={"prompt": " a person   walks ", "name": "walk", "seconds": 2.5})
    made = response.json()
    assert response.headers["location"] == f"/v1/streams/{made['id']}"
    assert (made["prompt"], made["name"], made["max_frames"]) == ("a person walks", "walk", 50)
    assert (made["state"], made["reason"], made["error"]) == ("waiting", None, None)
    assert made["bundle"].split("@")[0] == BUNDLE
    assert (made["model"], made["licence"], made["fps"], made["frames"]) == ("mogo", "MIT", 20.0, 0)
    assert 0 <= made["seed"] < 2**31
    assert made["prompts"] == []
    assert made["skeleton"]["names"] == list(HUMANML3D.joint_names)
    assert made["skeleton"]["parents"] == list(HUMANML3D.parents)
    np.testing.assert_allclose(made["skeleton"]["offsets"], HUMANML3D.offsets, atol=1e-6)
    assert http.get(f"/v1/streams/{made['id']}").json() == made


def test_streams_are_listed_newest_first_and_open_ones_alone_when_asked(http: httpx2.Client) -> None:
    ids = [begin(http)["id"] for _ in range(3)]
    http.delete(f"/v1/streams/{ids[1]}")
    page = http.get("/v1/streams", params={"limit": 2}).json()
    assert [row["id"] for row in page["items"]] == [ids[2], ids[1]]
    assert {"skeleton", "prompts"}.isdisjoint(page["items"][0])
    following = http.get("/v1/streams", params={"limit": 1, "cursor": page["next"]}).json()
    assert [row["id"] for row in following["items"]] == [ids[0]]
    found = [row["id"] for row in http.get("/v1/streams", params={"open": True}).json()["items"]]
    assert [identifier for identifier in found if identifier in ids] == [ids[2], ids[0]]


@pytest.mark.parametrize(
    ("fields", "where", "words"),
    [
        ({"prompt": ""}, "prompt", "at least 1"),
        ({"prompt": "走る"}, "prompt", "English"),
        ({"prompt": "a\u0000b"}, "prompt", "NUL"),
        ({"name": "../x"}, "name", "file name"),
        ({"seed": -1}, "seed", "greater than or equal to 0"),
        ({"seed": True}, "seed", "valid integer"),
        ({"seconds": 0.5}, "seconds", "greater than or equal to 1"),
        ({"seconds": 601}, "seconds", "less than or equal to 600"),
        ({"model": "hgm3"}, "model", "cannot make motion frame by frame"),
        ({"model": "nobody"}, "model", "no model or bundle"),
        ({"colour": "red"}, "colour", "Extra inputs"),
    ],
)
def test_what_cannot_be_streamed_is_told(
    http: httpx2.Client, fields: dict[str, object], where: str | None, words: str
) -> None:
    problem = refused(http.post("/v1/streams", json={**WALK, **fields}), 422, "invalid-input")
    assert problem.get("where") == where
    assert words in problem["detail"]


def test_a_fifth_open_stream_of_a_key_is_429_and_an_end_makes_room(api: LiveApi, http: httpx2.Client) -> None:
    ids = [begin(http)["id"] for _ in range(4)]
    response = http.post("/v1/streams", json=WALK)
    refused(response, 429, "busy")
    assert int(response.headers["retry-after"]) > 0
    with api.http("submit") as other:
        begin(other)
    http.delete(f"/v1/streams/{ids[0]}")
    begin(http)


def test_a_stream_that_waits_is_over_as_soon_as_it_is_deleted(
    api: LiveApi, http: httpx2.Client, stream: str, client: redis.Redis
) -> None:
    for _ in range(2):
        response = http.delete(f"/v1/streams/{stream}")
        assert response.status_code == 202
        assert (response.json()["state"], response.json()["reason"]) == ("ended", "stopped")
    with transaction(api.engine) as conn:
        assert take_stream(conn, UUID(stream), 1, "late") is None
    assert ControlQueue(client, stream).read() == []


def test_a_stream_that_a_worker_has_is_asked_to_stop(http: httpx2.Client, stream: str, hand: Hand) -> None:
    response = http.delete(f"/v1/streams/{stream}")
    assert (response.status_code, response.json()["state"]) == (202, "live")
    assert hand.heard() == [Control("stop")]


def test_a_worker_that_takes_a_stream_while_it_is_deleted_has_it_and_hears_of_that(
    api: LiveApi, http: httpx2.Client, stream: str, client: redis.Redis
) -> None:
    answers: list[httpx2.Response] = []
    deleting = threading.Thread(target=lambda: answers.append(http.delete(f"/v1/streams/{stream}")))
    with transaction(api.engine) as conn:
        assert take_stream(conn, UUID(stream), 1, "hand") is not None
        deleting.start()
        until(lambda: waiting_for_a_row(api.engine))
    deleting.join(PATIENCE)
    assert answers[0].json()["state"] == "live"
    assert [control for _, control in ControlQueue(client, stream).read()] == [Control("stop")]


def test_the_stream_of_another_tenant_is_404_over_http_and_over_the_socket(api: LiveApi, stream: str) -> None:
    with transaction(api.engine) as conn:
        conn.execute(sa.insert(schema.tenant).values(id="other"))
    foreign = new_key(api, "admin", tenant="other")
    with httpx2.Client(base_url=api.url, headers={"Authorization": f"Bearer {foreign}"}) as http:
        refused(http.get(f"/v1/streams/{stream}"), 404, "not-found")
        refused(http.delete(f"/v1/streams/{stream}"), 404, "not-found")
        assert http.get("/v1/streams").json()["items"] == []
    assert close_code(api, stream, foreign) == 4404


def test_beginning_and_ending_want_submit_and_looking_wants_read(api: LiveApi, stream: str) -> None:
    with api.http("read") as reader, api.http("submit") as submitter:
        assert reader.get(f"/v1/streams/{stream}").status_code == 200
        refused(reader.post("/v1/streams", json=WALK), 403, "refused")
        refused(reader.delete(f"/v1/streams/{stream}"), 403, "refused")
        refused(submitter.get(f"/v1/streams/{stream}"), 403, "refused")
        refused(submitter.get("/v1/streams"), 403, "refused")


def test_a_stream_outlives_its_bundle(api: LiveApi, http: httpx2.Client, stream: str) -> None:
    with transaction(api.engine) as conn:
        conn.execute(sa.update(schema.stream).values(bundle="gone@0123456789ab").where(schema.stream.c.id == stream))
    found = http.get(f"/v1/streams/{stream}").json()
    assert (found["licence"], found["fps"], found["skeleton"]) == (None, None, None)
    assert stream in [row["id"] for row in http.get("/v1/streams").json()["items"]]


# --- who may open a socket ---


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
    for query in ("from=-1", "from=x", "from=1.5", "from=4294967296", "from=１", "slow=stop", "slow="):
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


def test_without_redis_streams_say_which_setting_lacks_and_the_rest_works(
    config: Settings, stream: str, secret: str
) -> None:
    headers = {"Authorization": f"Bearer {secret}"}
    with ApiThread(beside(config, queue_url=None)) as url, httpx2.Client(base_url=url, headers=headers) as http:
        for response in (http.post("/v1/streams", json=WALK), http.delete(f"/v1/streams/{stream}")):
            assert refused(response, 503, "unreachable")["where"] == "MAREY_QUEUE_URL"
        assert http.get(f"/v1/streams/{stream}").status_code == 200
        assert http.post("/v1/jobs", json={"items": [{**WALK, "model": "hgm3"}]}).status_code == 202
        with watching(url, stream, secret) as viewer:
            assert viewer.closed() == (1013, "live streams need Redis, and none is named")


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
    (gap,) = seen.of("gap")
    assert gap["count"] > 0
    behind = gap["first"] + gap["count"]
    assert seen.numbers == [*range(5, gap["first"]), *range(behind, LATE + 5)]
    assert gap["first"] < LATE // 2, "too much was on its way to a client that took nothing"


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
        assert hand.heard() == [Control("pause")]
        hand.note(state=StreamState.PAUSED)
        assert slow.until_frame(LATE + 4).numbers == list(range(5, LATE + 5))
        assert hand.heard() == [Control("resume")]


def test_a_client_that_goes_away_leaves_no_stream_paused(api: LiveApi, stream: str, secret: str, hand: Hand) -> None:
    with watching(api.url, f"{stream}?slow=pause", secret, narrow=True) as slow:
        hand.show(5)
        slow.until_frame(4)
        for _ in range(LATE // 100):
            hand.show(100)
        assert hand.heard() == [Control("pause")]
        slow.connection.socket.close()
    assert hand.heard() == [Control("resume")]


def test_a_stream_is_watched_as_long_as_a_socket_is_open(
    api: LiveApi, stream: str, secret: str, client: redis.Redis
) -> None:
    watch = Watch(client, stream)
    assert not watch.seen()
    with watching(api.url, stream, secret) as viewer:
        until(watch.seen)
        client.delete(watch.key)
        until(watch.seen)
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
        hand.note((20, "a person jumps"))
        told = viewer.until("stream").of("stream")[-1]["stream"]
        while len(told["prompts"]) < 2:
            told = viewer.until("stream").of("stream")[-1]["stream"]
    assert told["prompts"] == [
        {"number": 0, "frame": 0, "prompt": "a person walks"},
        {"number": 1, "frame": 20, "prompt": "a person jumps"},
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


# --- control ---


def test_what_a_client_asks_reaches_the_worker(api: LiveApi, stream: str, secret: str, hand: Hand) -> None:
    with watching(api.url, stream, secret) as viewer:
        viewer.ask("steer", prompt="  a person   jumps ")
        viewer.ask("pause")
        viewer.connection.send(b'{"kind": "resume"}')
        viewer.ask("stop")
        heard: list[Control] = []
        while len(heard) < 4:
            heard += hand.heard()
    assert heard == [Control("steer", "a person jumps"), Control("pause"), Control("resume"), Control("stop")]


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
        assert hand.heard() == [Control("pause")]


def test_a_message_that_is_far_too_long_closes_the_socket(api: LiveApi, stream: str, secret: str) -> None:
    with watching(api.url, stream, secret) as viewer:
        viewer.until("stream")
        viewer.connection.send("x" * 70_000)
        assert viewer.closed()[0] == 1009


def test_too_many_messages_at_once_are_told(api: LiveApi, stream: str, secret: str, hand: Hand) -> None:
    with watching(api.url, stream, secret) as viewer:
        for _ in range(300):
            viewer.ask("pause")
        assert viewer.until("error").of("error")[0]["problem"]["type"] == "urn:marey:problem:busy"
    assert len(hand.heard()) >= 1


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
    assert "Redis does not serve" in reason


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


def beside(config: Settings, **changes: str | None) -> Settings:
    """Settings of another API process on the same database and queue, but for the changes."""
    assert config.database_url is not None
    assert config.queue_url is not None
    own = settings_of(config.home, config.database_url.get_secret_value(), config.queue_url.get_secret_value())
    return Settings.model_validate({**own.model_dump(), **changes})


def waiting_for_a_row(engine: sa.Engine) -> bool:
    """Whether a transaction on this database waits for another to commit."""
    asked = "SELECT count(*) FROM pg_stat_activity WHERE datname = current_database() AND wait_event_type = 'Lock'"
    with transaction(engine) as conn:
        return conn.execute(sa.text(asked)).scalar_one() > 0


def until(holds: Callable[[], object]) -> None:
    """Wait until something holds."""
    deadline = time.monotonic() + PATIENCE
    while not holds():
        assert time.monotonic() < deadline
        time.sleep(0.05)
