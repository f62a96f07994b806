"""Two tenants on one server: what one has is not there for the other, on any route, and every change is on record."""

from __future__ import annotations

import hashlib
import itertools
import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any
from uuid import UUID

import httpx2
import pytest
from fastapi.routing import APIRoute, APIWebSocketRoute
from websockets.exceptions import ConnectionClosed

from marey.api.app import ROUTERS
from marey.db import transaction
from marey.embedded import EmbeddedServer
from marey.exporters import Coordinates, exporter_of
from marey.tenants import (
    Quotas,
    authenticate,
    create_tenant,
    list_audit,
    revoke_key,
    set_quotas,
    suspend_tenant,
)
from tests.support.auth_states import ENDINGS, end_key
from tests.support.command import Command
from tests.support.evaluations import GENERATOR
from tests.support.live_evaluations import Studio, studio
from tests.support.live_streams import BUNDLE as STREAMER
from tests.support.live_streams import add_streamer, watching
from tests.support.walker import walker

PROMPT = "a secretive person waltzes"
NAME = "unreleased film"
EVALUATION: dict[str, Any] = {
    "bundle": GENERATOR,
    "prompts": [{"prompt": PROMPT, "seconds": 2}, {"prompt": "walk"}],
    "source": "film.csv",
    "name": NAME,
}
BODIES: dict[str, dict[str, Any]] = {
    "POST /v1/jobs": {"items": [{"prompt": PROMPT, "name": "w", "model": GENERATOR}], "name": NAME},
    "POST /v1/streams": {"prompt": PROMPT, "name": NAME, "model": STREAMER},
    "POST /v1/evaluations": EVALUATION,
    "POST /v1/schedules": {"cron": "0 3 * * 1", **EVALUATION},
    "POST /v1/webhooks": {"url": "http://127.0.0.1:9/hook", "name": NAME},
    "PATCH /v1/webhooks/{webhook}": {"name": "another"},
    "PATCH /v1/jobs/{job}": {"priority": 5, "comment": "x"},
    "PATCH /v1/schedules/{schedule}": {"paused": True},
    "POST /v1/motions/files": {"motions": ["<motion>"], "formats": ["bvh"]},
    "POST /v1/motions/review": {"motions": ["<motion>"], "verdict": "kept"},
    "POST /v1/motions/reroll": {"motions": ["<motion>"]},
    "POST /v1/motions/{motion}/edits": {"ops": [{"op": "mirror"}]},
    "POST /v1/streams/{stream}/end": {"pose": {"joint_rotations": [[1, 0, 0, 0]] * 22}},
}
"""`<motion>` stands for the id of one."""
NOBODYS = {
    "/", "/livez", "/readyz", "/live", "/live/{file}", "/v1/models", "/v1/models/{name}", "/v1/texts/parse",
}  # fmt: skip
"""Paths that tell the same to everybody."""
READ_BY_POST = {"/v1/motions/files"}
"""Paths of POST requests that change nothing."""
OF_ALL = {"/metrics"}
"""Paths that tell of all tenants, and want a scope that no other holds."""
RIG, RIG_FILE = "unreleased-hero", exporter_of("bvh").encode(walker(seconds=0.5), Coordinates())
ORDER = ("GET", "PATCH", "POST", "DELETE")


def routes(kind: type) -> list[Any]:
    return [route for router in ROUTERS for route in router.routes if isinstance(route, kind)]


def requests() -> list[tuple[str, str]]:
    """Method and path of all that a key is asked for and that concerns a tenant."""
    found = [
        (method, route.path)
        for route in routes(APIRoute)
        if route.path not in NOBODYS | OF_ALL
        for method in route.methods - {"HEAD"}
    ]
    return sorted(found, key=lambda each: (ORDER.index(each[0]), each[1]))


@dataclass
class Mine:
    """Resources of one tenant."""

    ids: dict[str, str]
    """By the names that paths give them: a route with a name that is not here fails the tests."""
    sha256: str

    def path(self, template: str) -> str:
        own = "html" if "report" in template else "npz"
        return re.sub(r"{(\w+)}", lambda name: self.ids[name[1]], template.replace("{format}", own))

    def body(self, request: str) -> Any:
        body = json.dumps(BODIES.get(request))
        return json.loads(re.sub(r"<(\w+)>", lambda name: self.ids[name[1]], body))

    def send(self, http: httpx2.Client, method: str, template: str) -> httpx2.Response:
        own = {"before": self.ids["evaluation"]} if template.endswith("/comparison") else None
        if template == "/v1/resolve":
            own = {"kind": "job", "reference": self.ids["job"][-8:]}
        if (method, template) == ("POST", "/v1/rigs"):
            return http.post(template, params={"name": "another", "format": "bvh"}, content=RIG_FILE)
        return http.request(method, self.path(template), json=self.body(f"{method} {template}"), params=own)

    def secrets(self) -> list[str]:
        return [PROMPT, NAME, self.sha256]


@pytest.fixture(scope="module")
def place(
    module_database_url: str, valkey: EmbeddedServer, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Studio]:
    with studio(tmp_path_factory.mktemp("tenants"), module_database_url, valkey.url) as place:
        add_streamer(place.config)
        with transaction(place.api.engine) as conn:
            create_tenant(conn, "rival")
        yield place


def accepted(response: httpx2.Response) -> dict[str, Any]:
    assert response.status_code in (200, 201, 202), response.text
    return response.json()


@pytest.fixture
def mine(place: Studio) -> Iterator[Mine]:
    with place.api.http() as http:
        ids = {
            noun: accepted(http.post(path, json=BODIES[f"POST {path}"]))["id"]
            for noun, path in (
                ("job", "/v1/jobs"), ("stream", "/v1/streams"), ("evaluation", "/v1/evaluations"),
                ("schedule", "/v1/schedules"), ("webhook", "/v1/webhooks"),
            )
        }  # fmt: skip
        accepted(http.post("/v1/rigs", params={"name": RIG, "format": "bvh"}, content=RIG_FILE))
        ids["event"] = accepted(http.post(f"/v1/webhooks/{ids['webhook']}/test"))["event"]
        place.work()
        motion = http.get(f"/v1/jobs/{ids['job']}/motions").json()["items"][0]
        sha256 = next(file["sha256"] for file in motion["files"] if file["format"] == "npz")
        assert accepted(http.get(f"/v1/evaluations/{ids['evaluation']}"))["state"] == "done"
        yield Mine({**ids, "motion": motion["id"], "rig": RIG}, sha256)
        http.delete(f"/v1/streams/{ids['stream']}")


def test_on_no_route_does_a_key_reach_what_another_tenant_has(place: Studio, mine: Mine) -> None:
    """Every route of the application, with the ids of another tenant's things: 404, or lists without them. Then the
    owner's key on the same paths: they lead to something."""
    before = snapshot(place, mine)
    with place.http("admin", tenant="rival") as rival:
        for method, template in requests():
            response = mine.send(rival, method, template)
            what = f"{method} {template}: {response.status_code} {response.text[:300]}"
            if "{" in template or "<" in str(BODIES.get(f"{method} {template}")):
                assert response.status_code == 404, what
                assert response.json()["type"] == "urn:marey:problem:not-found", what
                assert not [secret for secret in mine.secrets() if secret in response.text], what
            else:
                assert response.status_code < 300, what
                assert not [mark for mark in (*mine.ids.values(), mine.sha256) if mark in response.text], what
    assert snapshot(place, mine) == before
    with place.api.http() as owner:
        for method, template in requests():
            response = mine.send(owner, method, template)
            assert response.status_code < 300 or response.status_code == 409, f"{method} {template}: {response.text}"


def snapshot(place: Studio, mine: Mine) -> list[object]:
    """All that its owner is told of it."""
    paths = [path for method, path in requests() if method == "GET" and "{" in path]
    with place.api.http() as owner:
        return [(path, mine.send(owner, "GET", path).text) for path in paths]


def test_no_socket_shows_what_another_tenant_has(place: Studio, mine: Mine) -> None:
    sockets = [route.path for route in routes(APIWebSocketRoute)]
    assert sockets == ["/v1/streams/{stream}"]  # another one wants a line of its own here
    with watching(place.api.url, mine.ids["stream"], place.key("admin", tenant="rival")) as viewer:
        with pytest.raises(ConnectionClosed):
            viewer.connection.recv(timeout=20)
        assert viewer.closed()[0] == 4404
    with watching(place.api.url, mine.ids["stream"], place.api.key) as viewer:
        assert viewer.until("stream").of("stream")[0]["stream"]["id"] == mine.ids["stream"]


def test_the_hash_of_content_opens_nothing(place: Studio, mine: Mine) -> None:
    """Knowledge of a file's content or hash gives no access to another tenant's file."""
    path = f"/v1/motions/{mine.ids['motion']}/files/npz"
    with place.http("admin", tenant="rival") as rival:
        for etag in (f'"{mine.sha256}"', "*"):
            assert rival.get(path, headers={"If-None-Match": etag}).status_code == 404
        assert rival.get(f"/v1/motions/{mine.sha256}").status_code == 422
        for name in ("sha256", "text_key", "files"):
            body = {"items": [{"prompt": PROMPT, "model": GENERATOR, name: mine.sha256}]}
            assert rival.post("/v1/jobs", json=body).status_code == 422
        job = accepted(rival.post("/v1/jobs", json=BODIES["POST /v1/jobs"]))
        items = rival.get(f"/v1/jobs/{job['id']}/items").json()["items"]
        assert [item["motion"] for item in items] == [None]
        place.work()
        motions = rival.get(f"/v1/jobs/{job['id']}/motions").json()["items"]
        assert [motion["id"] == mine.ids["motion"] for motion in motions] == [False]
    with place.api.http() as owner:
        content = owner.get(path).content
    assert hashlib.sha256(content).hexdigest() == mine.sha256


def test_no_parameter_and_no_body_leads_to_what_another_tenant_has(place: Studio, mine: Mine) -> None:
    with place.http("admin", tenant="rival") as rival:
        assert rival.get("/v1/motions", params={"job": mine.ids["job"]}).status_code == 404
        found = rival.get("/v1/motions", params={"text": "waltzes", "limit": 1000}).json()["items"]
        assert mine.ids["motion"] not in [row["id"] for row in found]
        again = rival.post("/v1/evaluations", json={**EVALUATION, "baseline": mine.ids["evaluation"]})
        assert (again.status_code, NAME in again.text) == (422, False)


def test_an_idempotency_key_is_a_tenants_own(place: Studio) -> None:
    headers = {"Idempotency-Key": "the-same"}
    body = BODIES["POST /v1/jobs"]
    with place.api.http() as owner, place.http("submit", tenant="rival") as rival:
        first = owner.post("/v1/jobs", json=body, headers=headers)
        second = rival.post("/v1/jobs", json=body, headers=headers)
        assert "Idempotency-Replayed" not in second.headers
        assert accepted(first)["id"] != accepted(second)["id"]


# --- the audit log ---


def test_every_request_that_changes_something_is_on_record(place: Studio, mine: Mine) -> None:
    key = place.key("admin")
    with httpx2.Client(base_url=place.api.url, headers={"Authorization": f"Bearer {key}"}, timeout=30) as http:
        job = accepted(http.post("/v1/jobs", json=BODIES["POST /v1/jobs"]))["id"]  # that pause and resume find open
        for method, template in requests():
            before = audited(place)
            status = Mine({**mine.ids, "job": job}, "").send(http, method, template).status_code
            noted = audited(place)[: len(audited(place)) - len(before)]
            changes = method != "GET" and template not in READ_BY_POST
            assert len(noted) == (changes and status < 300), f"{method} {template}: {status}, {noted}"
            if noted:
                noun = template.split("/")[2].removesuffix("s")
                assert noted[0][0].startswith(f"{noun}."), (template, noted)
                assert noted[0][1] == "default"
                assert PROMPT not in str(noted)


def audited(place: Studio) -> list[tuple[str, str, str, str]]:
    """Newest first."""
    with transaction(place.api.engine) as conn:
        rows = list_audit(conn, tenant="default", limit=1000).rows
    return [(row.verb, row.actor, row.target, str(row.data)) for row in rows]


def test_an_operator_says_why_and_the_events_tell_it(place: Studio) -> None:
    with place.api.http() as http:
        job = accepted(http.post("/v1/jobs", json=BODIES["POST /v1/jobs"]))["id"]
        for verb in ("pause", "resume", "cancel", "retry"):
            accepted(http.post(f"/v1/jobs/{job}/{verb}", params={"reason": f"{verb} it"}))
        accepted(http.post(f"/v1/jobs/{job}/pause"))
        events = [event for event in http.get(f"/v1/jobs/{job}/events").json()["items"] if event["kind"] != "state"]
        told = ["pause it", "resume it", "cancel it", "retry it", "paused by all"]
        assert [event["reason"] for event in events[1:]] == told
        http.post(f"/v1/jobs/{job}/cancel")
    assert [(verb, "retry it" in data) for verb, _, target, data in audited(place) if target == job][2:4] == [
        ("job.retry", True), ("job.cancel", False),
    ]  # fmt: skip


def test_the_command_line_has_the_same_verbs_with_their_reasons(place: Studio) -> None:
    marey = Command({"MAREY_SERVER": place.api.url, "MAREY_KEY": place.api.key})
    with place.api.http() as http:
        job = accepted(http.post("/v1/jobs", json=BODIES["POST /v1/jobs"]))["id"]
        for verb in ("pause", "resume", "cancel", "retry"):
            marey("jobs", verb, job, "--reason", f"{verb} it").ok()
        marey("jobs", "priority", job, "--reason", "it is late", "--", -7).ok()
        assert "fails early above 0.25" in marey("jobs", "fail-early", job, 0.25, "--reason", "it is dear").ok().err
        marey("jobs", "fail-early", job, "none").ok()
        marey("jobs", "fail-early", job, "nan").refused(2, "is not a share")
        assert json.loads(marey("jobs", "comment", job, "for Monday", "--json").ok().out)["priority"] == -7
        events = [event for event in http.get(f"/v1/jobs/{job}/events").json()["items"] if event["kind"] != "state"]
        told = ["pause it", "resume it", "cancel it", "retry it", "priority -7: it is late"]
        told += ["fails early above a share of 0.25: it is dear", "never fails early: set by all", "for Monday"]
        assert [event["reason"] for event in events[1:]] == told
        marey("jobs", "cancel", job).ok()


# --- quotas and suspension over HTTP ---


def test_a_full_queue_is_a_429_that_says_which_quota_and_what_is_left(place: Studio) -> None:
    with transaction(place.api.engine) as conn:
        create_tenant(conn, "small", Quotas(queued=2))
    walk = {"prompt": "a person walks", "model": GENERATOR}
    with place.http("submit", tenant="small") as http:
        accepted(http.post("/v1/jobs", json={"items": [walk]}))
        response = http.post("/v1/jobs", json={"items": [walk, walk]})
    assert response.status_code == 429
    assert response.headers["Retry-After"] == "30"
    problem = response.json()
    assert problem["type"] == "urn:marey:problem:quota"
    assert problem["quota"] == {"name": "queued", "limit": 2, "used": 1, "left": 1, "asked": 2}


def test_an_evaluation_waits_for_room_in_the_queue_and_fails_if_it_can_never_have_it(place: Studio) -> None:
    with transaction(place.api.engine) as conn:
        create_tenant(conn, "patient", Quotas(queued=2))
    with place.http("admin", tenant="patient") as http:
        job = accepted(http.post("/v1/jobs", json=BODIES["POST /v1/jobs"]))["id"]
        waits = accepted(http.post("/v1/evaluations", json=EVALUATION))["id"]
        three = {**EVALUATION, "prompts": [{"prompt": text} for text in (PROMPT, "walk", "run")]}
        never = accepted(http.post("/v1/evaluations", json=three))["id"]
        place.scheduler.round()
        assert http.get(f"/v1/evaluations/{waits}").json()["state"] == "planned"
        assert "quota" in http.get(f"/v1/evaluations/{never}").json()["reason"]
        accepted(http.post(f"/v1/jobs/{job}/cancel"))
        place.scheduler.round()
        assert http.get(f"/v1/evaluations/{waits}").json()["state"] == "generating"
    with transaction(place.api.engine) as conn:
        set_quotas(conn, "patient", {"queued": None})
    place.work()


def test_of_a_suspended_tenant_no_request_is_answered_and_open_sockets_close(place: Studio) -> None:
    with transaction(place.api.engine) as conn:
        create_tenant(conn, "late")
    key = place.key("admin", tenant="late")
    with httpx2.Client(base_url=place.api.url, headers={"Authorization": f"Bearer {key}"}) as http:
        stream = accepted(http.post("/v1/streams", json=BODIES["POST /v1/streams"]))["id"]
        with watching(place.api.url, stream, key) as viewer:
            viewer.until("stream")
            with transaction(place.api.engine) as conn:
                suspend_tenant(conn, "late")
            assert viewer.closed()[0] == 4403
        response = http.get("/v1/jobs")
    assert (response.status_code, response.json()["type"]) == (403, "urn:marey:problem:refused")
    assert "suspended" in response.json()["detail"]


def test_a_revoked_key_loses_its_open_socket(place: Studio, mine: Mine) -> None:
    key = place.key("read")
    with watching(place.api.url, mine.ids["stream"], key) as viewer:
        viewer.until("stream")
        with place.api.http() as http, transaction(place.api.engine) as conn:
            assert http.get("/v1/jobs").status_code == 200
            revoke_key(conn, "default", key_id(place, key))
        assert viewer.closed()[0] == 4401


@pytest.mark.parametrize("ending", ENDINGS)
def test_an_event_stream_ends_with_its_key(place: Studio, ending: str) -> None:
    tenant = f"tenant-{ending}"
    with transaction(place.api.engine) as conn:
        create_tenant(conn, tenant)
    key, other = place.key("admin", tenant=tenant), place.key("admin", tenant=tenant)
    with httpx2.Client(base_url=place.api.url, headers={"Authorization": f"Bearer {key}"}, timeout=30) as http:
        job = accepted(http.post("/v1/jobs", json=BODIES["POST /v1/jobs"]))["id"]
        asked = {"headers": {"Accept": "text/event-stream"}}
        with http.stream("GET", f"/v1/jobs/{job}/events", **asked) as stream:
            lines = stream.iter_lines()
            assert "submitted" in "".join(itertools.takewhile(lambda line: "data:" not in line, lines))
            with transaction(place.api.engine) as conn:
                end_key(conn, ending, tenant, authenticate(conn, key).id)
            assert all("error" not in line for line in lines)  # it ends, and does not break off
        assert http.get(f"/v1/jobs/{job}/events", **asked).status_code == (403 if ending == "suspended" else 401)
    if ending != "suspended":
        with httpx2.Client(base_url=place.api.url, headers={"Authorization": f"Bearer {other}"}) as http:
            accepted(http.post(f"/v1/jobs/{job}/cancel"))


def key_id(place: Studio, secret: str) -> UUID:
    with transaction(place.api.engine) as conn:
        return authenticate(conn, secret).id
