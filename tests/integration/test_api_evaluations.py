"""`/v1/evaluations` and `/v1/schedules` through a real uvicorn, with a scheduler and a worker beside it."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from typing import Any
from uuid import uuid4

import httpx2
import pytest

from marey.db import transaction
from marey.jobs import WorkerHeartbeat, beat, retire
from tests.support.evaluations import GENERATOR, JUDGE
from tests.support.live_evaluations import Studio

PROMPTS: list[dict[str, Any]] = [
    {"prompt": "walk ahead", "seconds": 2, "expected": "Walk straight"},
    {"prompt": "walk and wave"},
]
BODY: dict[str, Any] = {"bundle": GENERATOR, "prompts": PROMPTS, "source": "studio.csv", "name": "before the release"}
EVERY_MONDAY: dict[str, Any] = {"cron": "0 3 * * 1", "time_zone": "Europe/Berlin", **BODY}


@pytest.fixture
def http(place: Studio) -> Iterator[httpx2.Client]:
    with place.api.http() as client:
        yield client


def begin(http: httpx2.Client, **changes: object) -> dict[str, Any]:
    response = http.post("/v1/evaluations", json={**BODY, **changes})
    assert response.status_code == 202, response.text
    assert response.headers["location"] == f"/v1/evaluations/{response.json()['id']}"
    return response.json()


def schedule(http: httpx2.Client, **changes: object) -> dict[str, Any]:
    response = http.post("/v1/schedules", json={**EVERY_MONDAY, **changes})
    assert response.status_code == 201, response.text
    assert response.headers["location"] == f"/v1/schedules/{response.json()['id']}"
    return response.json()


def refused(response: httpx2.Response, status: int, kind: str) -> dict[str, Any]:
    assert response.status_code == status, response.text
    assert response.headers["content-type"] == "application/problem+json"
    assert response.json()["type"] == f"urn:marey:problem:{kind}"
    return response.json()


def count(http: httpx2.Client, noun: str) -> int:
    return len(http.get(f"/v1/{noun}", params={"limit": 1000}).json()["items"])


@pytest.fixture(scope="module")
def done(place: Studio) -> dict[str, Any]:
    """An evaluation that is done."""
    with place.api.http() as http:
        made = begin(http, repeats=2, settings={"steps": 3}, comment="x")
        place.work()
        return http.get(f"/v1/evaluations/{made['id']}").json()


# --- evaluations ---


def test_an_evaluation_is_accepted_with_exact_bundles_and_waits(http: httpx2.Client) -> None:
    made = begin(http, seed=5)
    assert (made["state"], made["reason"], made["name"], made["prompts"]) == (
        "planned", "asked for", "before the release", 2,
    )  # fmt: skip
    request = made["request"]
    assert request["bundle"].startswith(f"{GENERATOR}@")
    assert request["evaluator"].startswith(f"{JUDGE}@")
    assert (request["model"], request["source"], request["repeats"], request["seed"]) == ("toy", "studio.csv", 1, 5)
    assert [event["state"] for event in made["events"]] == ["planned"]
    http.delete(f"/v1/evaluations/{made['id']}")


def test_the_same_request_with_its_key_makes_one_evaluation(http: httpx2.Client) -> None:
    def send(key: str, **changes: object) -> httpx2.Response:
        return http.post("/v1/evaluations", json={**BODY, **changes}, headers={"Idempotency-Key": key})

    first, again = send("one"), send("one")
    assert (first.status_code, "idempotency-replayed" in first.headers) == (202, False)
    assert (again.json()["id"], again.headers["idempotency-replayed"]) == (first.json()["id"], "true")
    refused(send("one", seed=7), 422, "idempotency-mismatch")
    other = send("two").json()["id"]
    assert other != first.json()["id"]
    job = http.post("/v1/jobs", json={"items": [{"prompt": "walk"}]}, headers={"Idempotency-Key": "one"})
    refused(job, 422, "idempotency-mismatch")
    for each in (first.json()["id"], other):
        http.delete(f"/v1/evaluations/{each}")


def test_an_evaluation_whose_queue_nobody_serves_says_so(place: Studio, http: httpx2.Client) -> None:
    made = begin(http)
    assert made["waits_for"] is None  # nothing is asked of a worker yet
    place.scheduler.round()
    waits = http.get(f"/v1/evaluations/{made['id']}").json()["waits_for"]
    assert waits == "a worker of the queue text: none is running"
    with transaction(place.api.engine) as conn:
        beat(conn, WorkerHeartbeat("w", "text", "host", 1, "cpu", None, None))
    assert http.get(f"/v1/evaluations/{made['id']}").json()["waits_for"] is None
    with transaction(place.api.engine) as conn:
        retire(conn, "w")
    http.delete(f"/v1/evaluations/{made['id']}")
    assert http.get(f"/v1/evaluations/{made['id']}").json()["waits_for"] is None


def test_one_that_is_done_tells_how_it_got_there_and_what_was_measured(done: dict[str, Any]) -> None:
    assert (done["state"], done["regressed"], done["summary"]["made"], done["summary"]["fid"]) == (
        "done", None, 4.0, None,
    )  # fmt: skip
    assert [event["state"] for event in done["events"]] == ["planned", "generating", "scoring", "done"]
    assert (done["generation"]["total"], done["generation"]["succeeded"], done["scoring"]["ended"]) == (4, 4, 1)
    assert done["finished"] >= done["started"] >= done["created"]


def test_a_report_is_served_as_the_files_of_motions_are(done: dict[str, Any], http: httpx2.Client) -> None:
    for file in done["reports"]:
        path = f"/v1/evaluations/{done['id']}/report/{file['format']}"
        whole = http.get(path)
        assert (whole.status_code, whole.headers["etag"]) == (200, f'"{file["sha256"]}"')
        assert hashlib.sha256(whole.content).hexdigest() == file["sha256"]
        assert whole.headers["content-type"] == file["media_type"]
        assert f"{done['id']}.{file['format']}" in whole.headers["content-disposition"]
        part = http.get(path, headers={"Range": "bytes=2-5"})
        assert (part.status_code, part.content) == (206, whole.content[2:6])
        assert http.get(path, headers={"If-None-Match": whole.headers["etag"]}).status_code == 304


def test_a_report_that_is_not_there_says_how_the_evaluation_stands(http: httpx2.Client) -> None:
    made = begin(http)
    problem = refused(http.get(f"/v1/evaluations/{made['id']}/report/html"), 404, "not-found")
    assert "is planned" in problem["detail"]
    refused(http.get(f"/v1/evaluations/{made['id']}/report/pdf"), 422, "invalid-input")
    http.delete(f"/v1/evaluations/{made['id']}")


def test_two_runs_of_the_same_prompts_are_compared_motion_by_motion(
    place: Studio, done: dict[str, Any], http: httpx2.Client
) -> None:
    place.judge.forget = 3
    try:
        other = begin(http, repeats=2, settings={"steps": 4})
        place.work()
    finally:
        place.judge.forget = 0
    path = f"/v1/evaluations/{other['id']}/comparison"
    found = http.get(path, params={"before": done["id"]}).json()
    assert (found["before"]["id"], found["after"]["id"], found["after"]["motions"]) == (done["id"], other["id"], 4)
    (change,) = found["changes"]
    assert change == {
        "metric": "obeyed", "before": 100.0, "after": 25.0, "low": -100.0, "high": -50.0, "prompts": 2, "motions": 4,
        "verdict": "worse",
    }  # fmt: skip
    assert found["regressed"] is True
    assert {"metric": "made", "before": 4.0, "after": 1.0} in found["others"]
    assert "fid" not in {each["metric"] for each in found["others"]}  # it was not measured
    back = http.get(f"/v1/evaluations/{done['id']}/comparison", params={"before": other["id"]}).json()
    assert (back["changes"][0]["verdict"], back["regressed"]) == ("better", False)


def test_runs_that_cannot_be_compared_are_refused_with_the_reason(
    place: Studio, done: dict[str, Any], http: httpx2.Client
) -> None:
    waiting, foreign = begin(http), begin(http, prompts=[*PROMPTS, {"prompt": "walk home"}], source="other.csv")
    place.work()
    unlike = http.post("/v1/evaluations", json={**BODY, "repeats": 3})
    open_run = unlike.json()["id"]
    for before, after, status, kind, said in (
        (foreign["id"], waiting["id"], 422, "invalid-input", "was made with other prompts (other.csv)"),
        (done["id"], open_run, 422, "invalid-input", "is planned, not done"),
        (open_run, done["id"], 422, "invalid-input", "is planned, not done"),
        (str(uuid4()), done["id"], 404, "not-found", "there is no such evaluation"),
        ("nonsense", done["id"], 422, "invalid-input", "before"),
    ):
        answer = http.get(f"/v1/evaluations/{after}/comparison", params={"before": before})
        assert said in refused(answer, status, kind)["detail"] + answer.text
    http.delete(f"/v1/evaluations/{open_run}")


def test_the_captions_of_the_evaluator_need_no_prompts(http: httpx2.Client) -> None:
    response = http.post("/v1/evaluations", json={"bundle": GENERATOR, "split": "test"})
    assert response.status_code == 202
    assert (response.json()["prompts"], response.json()["request"]["source"]) == (3, "test")
    http.delete(f"/v1/evaluations/{response.json()['id']}")


def test_cancelling_is_accepted_and_once_over_changes_nothing(http: httpx2.Client) -> None:
    made = begin(http)
    for _ in range(2):
        response = http.delete(f"/v1/evaluations/{made['id']}")
        assert (response.status_code, response.json()["state"]) == (202, "cancelled")
    assert [event["state"] for event in response.json()["events"]] == ["planned", "cancelled"]


def test_listings_are_pages_of_the_newest_first_by_state(http: httpx2.Client, done: dict[str, Any]) -> None:
    ids = [begin(http)["id"] for _ in range(3)]
    page = http.get("/v1/evaluations", params={"limit": 2}).json()
    assert [each["id"] for each in page["items"]] == ids[:0:-1]
    after = http.get("/v1/evaluations", params={"limit": 1, "cursor": page["next"]}).json()
    assert [each["id"] for each in after["items"]] == ids[:1]
    for each in ids:
        http.delete(f"/v1/evaluations/{each}")
    finished = http.get("/v1/evaluations", params={"state": ["done", "scoring"]}).json()["items"]
    assert done["id"] in [each["id"] for each in finished]
    assert {each["state"] for each in finished} == {"done"}
    refused(http.get("/v1/evaluations", params={"state": "asleep"}), 422, "invalid-input")
    refused(http.get("/v1/evaluations", params={"cursor": "x"}), 422, "invalid-input")


# --- what is refused ---


def test_all_bad_prompts_are_told_and_nothing_is_written(http: httpx2.Client) -> None:
    before = count(http, "evaluations")
    prompts = [*PROMPTS, {"prompt": ""}, {"prompt": "walk", "expected": "fly"}, {"prompt": "walk", "seed": 3}, 7]
    problem = refused(http.post("/v1/evaluations", json={**BODY, "prompts": prompts}), 422, "invalid-items")
    assert [(p["line"], p.get("field")) for p in problem["problems"]] == [
        (3, "prompt"), (4, "expected"), (5, "seed"), (6, None),
    ]  # fmt: skip
    assert "known: prompt, seconds, expected" in problem["problems"][2]["message"]
    assert count(http, "evaluations") == before


def test_all_lengths_that_the_model_cannot_make_are_told(http: httpx2.Client) -> None:
    prompts = [{"prompt": "walk", "seconds": seconds} for seconds in (0.6, 5, 30)]
    problem = refused(http.post("/v1/evaluations", json={**BODY, "prompts": prompts}), 422, "invalid-items")
    assert [(p["line"], p["field"]) for p in problem["problems"]] == [(1, "seconds"), (3, "seconds")]


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"bundle": "gone"}, "no model or bundle is named 'gone'"),
        ({"bundle": f"{GENERATOR}@000000000000"}, "not 000000000000"),
        ({"bundle": JUDGE}, "is of the kind evaluator, not a text-to-motion generator"),
        ({"bundle": "../etc"}, "'../etc' cannot be used: allowed are names of models and bundles"),
        ({"evaluator": "gone"}, "no model bundle is named 'gone'"),
        ({"evaluator": GENERATOR}, "is a generator, not an evaluator"),
        ({"prompts": []}, "there are no prompts"),
        ({"prompts": PROMPTS[:1]}, "more than one prompt"),
        ({"prompts": {"prompt": "walk"}}, "is not a list"),
        ({"prompts": None}, "neither is given"),
        ({"split": "test"}, "both are given"),
        ({"source": "test+compositional"}, "reserved for the evaluator's own prompts"),
        ({"prompts": None, "split": "val"}, "'val' is not known; known: test, compositional"),
        ({"prompts": None, "split": "compositional"}, "carries no captions of the split 'compositional'"),
        ({"settings": {"fps": 1000}}, "fps: 1000 is outside"),
        ({"settings": {"guidance": 2}}, "unknown setting 'guidance' of toy-starter"),
        ({"repeats": 0}, "repeats"),
        ({"seed": 2**31 - 1, "repeats": 2}, "plus 3 for the last motion"),
        ({"baseline": "00000000-0000-0000-0000-000000000000"}, "there is no such evaluation"),
        ({"name": "a\u0000b"}, "name"),
        ({"colour": 1}, "colour"),
    ],
)
def test_what_cannot_be_measured_is_refused_with_its_reason(
    http: httpx2.Client, changes: dict[str, Any], said: str
) -> None:
    before = count(http, "evaluations"), count(http, "schedules")
    for path, body in (("/v1/evaluations", BODY), ("/v1/schedules", EVERY_MONDAY)):
        response = http.post(path, json={**body, **changes})
        assert response.status_code == 422, response.text
        assert said in response.text.replace('\\"', '"')
    assert (count(http, "evaluations"), count(http, "schedules")) == before


@pytest.mark.parametrize("body", [b"", b"null", b"[]", b"{", b"\xff\xfe", b'{"bundle": "\\ud800"}', b"[" * 100_000])
def test_a_body_that_makes_no_sense_is_a_problem_and_no_500(http: httpx2.Client, body: bytes) -> None:
    made = schedule(http)["id"]
    for method, path in (("POST", "/v1/evaluations"), ("POST", "/v1/schedules"), ("PATCH", f"/v1/schedules/{made}")):
        response = http.request(method, path, content=body, headers={"Content-Type": "application/json"})
        assert response.status_code == 422, response.text
    http.delete(f"/v1/schedules/{made}")


def test_ten_thousand_prompts_are_taken_and_one_more_is_not(http: httpx2.Client) -> None:
    way = "in a large circle to the left, then stop in front of the door, wave with the right hand and go back"
    prompts = [{"prompt": f"walk {n} steps {way}"} for n in range(10_001)]
    assert len(json.dumps(prompts)) > 2**20  # more than other bodies may have
    problem = refused(http.post("/v1/evaluations", json={**BODY, "prompts": prompts}), 413, "too-large")
    assert "more than 10,000 prompts" in problem["detail"]
    made = begin(http, prompts=prompts[1:])
    assert made["prompts"] == 10_000
    http.delete(f"/v1/evaluations/{made['id']}")


def test_what_is_not_there_is_not_found(http: httpx2.Client) -> None:
    for noun in ("evaluations", "schedules"):
        refused(http.get(f"/v1/{noun}/{uuid4()}"), 404, "not-found")
        refused(http.delete(f"/v1/{noun}/{uuid4()}"), 404, "not-found")
        refused(http.get(f"/v1/{noun}/nonsense"), 422, "invalid-input")
    refused(http.patch(f"/v1/schedules/{uuid4()}", json={"paused": True}), 404, "not-found")
    refused(http.post(f"/v1/schedules/{uuid4()}/run"), 404, "not-found")
    refused(http.get(f"/v1/schedules/{uuid4()}/evaluations"), 404, "not-found")


def test_a_foreign_tenants_key_sees_and_changes_nothing(
    place: Studio, http: httpx2.Client, done: dict[str, Any]
) -> None:
    mine = schedule(http)["id"]
    with place.http("admin", tenant="rival") as rival:
        assert (count(rival, "evaluations"), count(rival, "schedules")) == (0, 0)
        for method, path in (
            ("GET", f"/v1/evaluations/{done['id']}"),
            ("DELETE", f"/v1/evaluations/{done['id']}"),
            ("GET", f"/v1/evaluations/{done['id']}/report/html"),
            ("GET", f"/v1/evaluations/{done['id']}/comparison?before={done['id']}"),
            ("GET", f"/v1/schedules/{mine}"),
            ("DELETE", f"/v1/schedules/{mine}"),
            ("POST", f"/v1/schedules/{mine}/run"),
            ("GET", f"/v1/schedules/{mine}/evaluations"),
        ):
            refused(rival.request(method, path), 404, "not-found")
        refused(rival.patch(f"/v1/schedules/{mine}", json={"paused": True}), 404, "not-found")
        refused(rival.post("/v1/evaluations", json={**BODY, "baseline": done["id"]}), 422, "invalid-input")
    assert http.get(f"/v1/schedules/{mine}").json()["paused"] is False
    http.delete(f"/v1/schedules/{mine}")


def test_a_key_does_only_what_its_scopes_allow(place: Studio, http: httpx2.Client, done: dict[str, Any]) -> None:
    mine = schedule(http)["id"]
    with place.http("read") as reader, place.http("submit") as submitter:
        assert reader.get(f"/v1/evaluations/{done['id']}/report/md").status_code == 200
        for path, body in (("/v1/evaluations", BODY), ("/v1/schedules", EVERY_MONDAY)):
            refused(reader.post(path, json=body), 403, "refused")
            refused(submitter.get(path), 403, "refused")
        refused(reader.post(f"/v1/schedules/{mine}/run"), 403, "refused")
        for key in (reader, submitter):
            refused(key.delete(f"/v1/evaluations/{done['id']}"), 403, "refused")
            refused(key.patch(f"/v1/schedules/{mine}", json={"paused": True}), 403, "refused")
            refused(key.delete(f"/v1/schedules/{mine}"), 403, "refused")
        made = submitter.post("/v1/evaluations", json=BODY)
        assert made.status_code == 202
    http.delete(f"/v1/evaluations/{made.json()['id']}")
    http.delete(f"/v1/schedules/{mine}")
    refused(httpx2.get(f"{place.api.url}/v1/evaluations"), 401, "unauthenticated")


# --- schedules ---


def test_a_schedule_keeps_the_names_and_tells_when_it_is_due(http: httpx2.Client) -> None:
    made = schedule(http)
    request = made["request"]
    assert (request["bundle"], request["evaluator"], request["model"]) == (GENERATOR, None, None)
    assert (made["cron"], made["time_zone"], made["paused"], made["prompts"]) == (
        "0 3 * * 1", "Europe/Berlin", False, 2,
    )  # fmt: skip
    assert made["next"] > made["created"]
    assert made["last"] is None
    assert http.get(f"/v1/schedules/{made['id']}").json() == made
    assert made["id"] in [each["id"] for each in http.get("/v1/schedules").json()["items"]]
    assert http.delete(f"/v1/schedules/{made['id']}").status_code == 204
    refused(http.get(f"/v1/schedules/{made['id']}"), 404, "not-found")


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"cron": "0 3 * *"}, "does not have five fields"),
        ({"cron": "0 25 * * *"}, "bad hour"),
        ({"cron": "0 3 30 2 *"}, "bad day-of-month"),
        ({"cron": ""}, "cron"),
        ({"time_zone": "Europe/Berlun"}, "Did you mean Europe/Berlin"),
        ({"time_zone": "../../etc/passwd"}, "there is no time zone"),
    ],
)
def test_a_bad_time_is_refused_and_changes_nothing(http: httpx2.Client, changes: dict[str, Any], said: str) -> None:
    made = schedule(http)
    before = count(http, "schedules")
    for response in (
        http.post("/v1/schedules", json={**EVERY_MONDAY, **changes}),
        http.patch(f"/v1/schedules/{made['id']}", json=changes),
    ):
        assert response.status_code == 422
        assert said in response.text
    assert http.get(f"/v1/schedules/{made['id']}").json() == made
    assert count(http, "schedules") == before
    http.delete(f"/v1/schedules/{made['id']}")


def test_what_a_patch_names_is_changed_and_nothing_else(http: httpx2.Client) -> None:
    made = schedule(http)
    path = f"/v1/schedules/{made['id']}"
    paused = http.patch(path, json={"paused": True}).json()
    assert (paused["paused"], paused["next"], paused["cron"]) == (True, None, "0 3 * * 1")
    moved = http.patch(path, json={"paused": False, "cron": "30 4 * * *", "name": "daily"}).json()
    assert (moved["paused"], moved["cron"], moved["name"]) == (False, "30 4 * * *", "daily")
    other = http.patch(path, json={"request": {"bundle": GENERATOR, "split": "test", "repeats": 3}}).json()
    assert (other["request"]["source"], other["request"]["repeats"], other["prompts"]) == ("test", 3, None)
    assert other["next"] == moved["next"]
    for request in ({"bundle": "gone", "split": "test"}, {"bundle": GENERATOR}, {"bundle": GENERATOR, "cron": "x"}, 7):
        assert http.patch(path, json={"request": request}).status_code == 422
    assert http.get(path).json() == other
    http.delete(path)


def test_a_run_now_and_a_run_that_was_due_stand_in_the_history(place: Studio, http: httpx2.Client) -> None:
    made = schedule(http, name=None)
    path = f"/v1/schedules/{made['id']}"
    run = http.post(f"{path}/run")
    assert run.status_code == 202
    assert run.headers["location"] == f"/v1/evaluations/{run.json()['id']}"
    assert (run.json()["schedule"], run.json()["due"]) == (made["id"], None)
    place.work()
    place.make_due(made["id"])
    place.work()
    newest, oldest = http.get(f"{path}/evaluations").json()["items"]
    assert (oldest["id"], oldest["state"], newest["state"]) == (run.json()["id"], "done", "done")
    assert newest["due"] is not None
    assert newest["regressed"] is False  # compared with the run before it
    after = http.get(path).json()
    assert (after["last"], after["last_state"], after["last_regressed"]) == (newest["id"], "done", False)
    http.delete(path)
    assert http.get(f"/v1/evaluations/{newest['id']}").json()["schedule"] is None
