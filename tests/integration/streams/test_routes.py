"""Live streams over HTTP: a real uvicorn, Postgres and Valkey, and hands for a worker's live loop."""

from __future__ import annotations

import threading
from datetime import timedelta
from uuid import UUID

import httpx2
import numpy as np
import pytest
import redis
import sqlalchemy as sa

from marey.db import transaction
from marey.motion.body import standard_body
from marey.motion.skeleton import HUMANML3D
from marey.streams import get_stream, take_stream
from marey.streams import tables as stream_tables
from marey.streams.control import ControlQueue, StreamControl
from marey.tenants import tables as tenant_tables
from tests.support.live_api import LiveApi
from tests.support.live_streams import BUNDLE, PATIENCE, Hand
from tests.support.models import streaming_model
from tests.support.streams_api import WALK, begin, close_code, new_key, refused, until, waiting_for_a_row


def test_a_stream_begins_waiting_with_exact_bundle_drawn_seed_and_skeleton(http: httpx2.Client) -> None:
    response = http.post("/v1/streams", json={"prompt": " a person   walks ", "name": "walk", "seconds": 2.5})
    made = response.json()
    assert response.headers["location"] == f"/v1/streams/{made['id']}"
    assert (made["prompt"], made["name"], made["max_frames"]) == ("a person walks", "walk", 50)
    assert (made["state"], made["reason"], made["error"]) == ("waiting", None, None)
    assert made["bundle"].split("@")[0] == BUNDLE
    assert (made["model"], made["licence"], made["fps"], made["frames"]) == (streaming_model(), "MIT", 20.0, 0)
    assert 0 <= made["seed"] < 2**31
    assert made["prompts"] == []
    assert made["waits_for"] == "worker"
    assert made["skeleton"]["names"] == list(HUMANML3D.joint_names)
    assert made["skeleton"]["parents"] == list(HUMANML3D.parents)
    offsets = np.array(made["skeleton"]["offsets"], np.float32)
    np.testing.assert_array_equal(offsets, standard_body(HUMANML3D).skeleton.offsets)
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
        ({"prompt": ""}, "prompt", "is empty"),
        ({"prompt": "走る"}, "prompt", "English"),
        ({"prompt": "a\u0000b"}, "prompt", "NUL"),
        ({"name": "../x"}, "name", "file name"),
        ({"seed": -1}, "seed", "-1 is below 0, the least"),
        ({"seed": True}, "seed", "is true or false, not a whole number"),
        ({"seconds": 0.5}, "seconds", "0.5 is below 1, the least"),
        ({"seconds": 601}, "seconds", "601 is above 600, the most"),
        ({"model": "hgm3"}, "model", "cannot make motion frame by frame"),
        ({"model": "nobody"}, "model", "no model or bundle"),
        ({"colour": "red"}, "colour", "is not a known field; known: prompt, name, model, seed, seconds"),
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
    assert hand.received() == [StreamControl("stop")]


def test_a_worker_that_takes_a_stream_has_been_seen(api: LiveApi, stream: str) -> None:
    with transaction(api.engine) as conn:
        conn.execute(sa.text("UPDATE stream SET seen_at = now() - interval '1 hour'"))
    with transaction(api.engine) as conn:
        assert take_stream(conn, UUID(stream), 1, "hand") is not None
        age = conn.execute(sa.text("SELECT clock_timestamp() - seen_at FROM stream WHERE id = :id"), {"id": stream})
        assert age.scalar_one() < timedelta(minutes=1)
        started = get_stream(conn, "default", UUID(stream)).started
        assert started is not None
    with transaction(api.engine) as conn:
        assert take_stream(conn, UUID(stream), 2, "another") is not None
        assert get_stream(conn, "default", UUID(stream)).started == started, "it goes on"


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
    assert [control for _, control in ControlQueue(client, stream).read()] == [StreamControl("stop")]


def test_the_stream_of_another_tenant_is_404_over_http_and_over_the_socket(api: LiveApi, stream: str) -> None:
    with transaction(api.engine) as conn:
        conn.execute(sa.insert(tenant_tables.tenant).values(id="other"))
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
        conn.execute(
            sa.update(stream_tables.stream)
            .values(bundle="gone@0123456789ab")
            .where(stream_tables.stream.c.id == stream)
        )
    found = http.get(f"/v1/streams/{stream}").json()
    assert (found["licence"], found["fps"], found["skeleton"]) == (None, None, None)
    assert stream in [row["id"] for row in http.get("/v1/streams").json()["items"]]
