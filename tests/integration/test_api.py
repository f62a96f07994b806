"""The API through a real uvicorn, a real Postgres and a real Valkey."""

from __future__ import annotations

import contextlib
import hashlib
import json
import shutil
import tempfile
import threading
import time
from pathlib import Path
from uuid import uuid4

import httpx2
import pytest
import sqlalchemy as sa

from marey.core.errors import NotFound
from marey.core.spool import IN_MEMORY
from marey.db import transaction
from marey.jobs import WorkerHeartbeat, beat, record_scheduler_heartbeat, retire
from tests.support.live_api import BUNDLE, METADATA, LiveApi, wait_until

WALK, BOW = {"prompt": "a person walks"}, {"prompt": "a person bows"}


def submit(http: httpx2.Client, *items: dict[str, object], **fields: object) -> dict[str, object]:
    response = http.post("/v1/jobs", json={"items": items or (WALK,), **fields})
    assert response.status_code == 202, response.text
    return response.json()


def refused(response: httpx2.Response, status: int, kind: str) -> dict[str, object]:
    assert response.status_code == status, response.text
    assert response.headers["content-type"] == "application/problem+json"
    problem = response.json()
    assert problem["type"] == f"urn:marey:problem:{kind}"
    assert problem["status"] == status
    return problem


def jobs_there(http: httpx2.Client) -> int:
    return len(http.get("/v1/jobs", params={"limit": 1000}).json()["items"])


# --- submit ---


def test_a_job_of_json_is_accepted_with_exact_bundle_and_drawn_seeds(http: httpx2.Client) -> None:
    job = submit(
        http, {**WALK, "variants": 3, "seconds": 3}, {**BOW, "seed": 5, "name": "bow"}, name="day 1", priority=7
    )
    assert (job["total"], job["state"], job["name"], job["priority"]) == (4, "queued", "day 1", 7)
    items = http.get(f"/v1/jobs/{job['id']}/items").json()["items"]
    assert [(i["index"], i["variant"]) for i in items] == [(0, 0), (0, 1), (0, 2), (1, 0)]
    first = items[0]["seed"]
    assert [i["seed"] for i in items] == [first, first + 1, first + 2, 5]
    assert {i["bundle"].split("@")[0] for i in items} == {BUNDLE}
    assert all(len(i["bundle"].split("@")[1]) == 12 for i in items)


def test_a_job_of_ndjson_takes_its_own_fields_from_the_query(http: httpx2.Client) -> None:
    body = "\n".join(json.dumps(item) for item in (WALK, BOW)) + "\n"
    headers = {"Content-Type": "application/x-ndjson"}
    response = http.post("/v1/jobs", params={"name": "bulk", "priority": -3}, content=body, headers=headers)
    assert response.status_code == 202
    assert response.headers["location"] == f"/v1/jobs/{response.json()['id']}"
    assert (response.json()["total"], response.json()["priority"]) == (2, -3)


def test_all_problems_of_all_lines_are_told_and_nothing_is_written(http: httpx2.Client) -> None:
    before = jobs_there(http)
    lines = ['{"prompt": "a person walks"}', "{", '{"prompt": "", "speed": 1}', '{"prompt": "a man runs", "seed": -1}']
    response = http.post("/v1/jobs", content="\n".join(lines), headers={"Content-Type": "application/x-ndjson"})
    problem = refused(response, 422, "invalid-items")
    assert [(p["line"], p.get("field")) for p in problem["problems"]] == [
        (2, None), (3, "speed"), (3, "prompt"), (4, "seed"),
    ]  # fmt: skip
    assert jobs_there(http) == before


def test_only_the_first_thousand_problems_are_listed_and_all_are_counted(http: httpx2.Client) -> None:
    response = http.post("/v1/jobs", content="{\n" * 1500, headers={"Content-Type": "application/x-ndjson"})
    problem = refused(response, 422, "invalid-items")
    assert (len(problem["problems"]), problem["total"]) == (1000, 1500)


def test_a_length_or_model_this_server_cannot_make_names_its_line(http: httpx2.Client) -> None:
    response = http.post("/v1/jobs", json={"items": [WALK, {**WALK, "seconds": 30}, {**WALK, "model": "stroller"}]})
    problem = refused(response, 422, "invalid-items")
    assert [(p["line"], p["field"]) for p in problem["problems"]] == [(2, "seconds"), (3, "model")]
    assert "0.8 to 9.8 seconds" in problem["problems"][0]["message"]
    assert BUNDLE in problem["problems"][1]["message"]


def test_validate_only_checks_and_writes_nothing(http: httpx2.Client) -> None:
    before = jobs_there(http)
    response = http.post("/v1/jobs?validate_only=true", json={"items": [{**WALK, "variants": 4}]})
    assert response.status_code == 200
    assert (response.json()["valid"], response.json()["items"]) == (True, 4)
    assert jobs_there(http) == before


def test_the_same_key_and_body_give_the_same_job_and_another_body_is_refused(http: httpx2.Client) -> None:
    headers = {"Idempotency-Key": str(uuid4())}
    first = http.post("/v1/jobs", json={"items": [WALK]}, headers=headers)
    second = http.post("/v1/jobs", json={"items": [WALK]}, headers=headers)
    assert "idempotency-replayed" not in first.headers
    assert second.headers["idempotency-replayed"] == "true"
    assert (second.status_code, second.json()["id"]) == (202, first.json()["id"])
    refused(http.post("/v1/jobs", json={"items": [BOW]}, headers=headers), 422, "idempotency-mismatch")
    refused(http.post("/v1/jobs?name=x", json={"items": [WALK]}, headers=headers), 422, "idempotency-mismatch")


@pytest.mark.parametrize(
    "body",
    [b"", b"null", b"[]", b'{"items": []}', b'{"items": {}}', b'{"items": [1]}', b"{", b"\xff\xfe", b"{}",
     b"[" * 100_000,
     b'{"items": [{"prompt": "\\ud800"}]}', b'{"items": [{"\\ud800": 1}]}', b'{"items": [{"prompt": NaN}]}',
     b'{"items": [{"prompt": "walks", "seconds": 1e999}]}', b'{"items": [{"prompt": "walks"}], "priority": 5000}',
     b'{"items": [{"prompt": "walks"}], "name": "a\\u0000b"}', b'{"items": [{"prompt": "walks"}], "colour": 1}'],
)  # fmt: skip
def test_a_body_that_makes_no_sense_is_a_problem_and_no_500(http: httpx2.Client, body: bytes) -> None:
    response = http.post("/v1/jobs", content=body, headers={"Content-Type": "application/json"})
    assert response.status_code == 422, response.text
    assert response.json()["type"].startswith("urn:marey:problem:invalid-")


def test_too_many_items_and_too_large_a_body_are_413(http: httpx2.Client) -> None:
    headers = {"Content-Type": "application/x-ndjson"}
    refused(http.post("/v1/jobs", content="{}\n" * 100_001, headers=headers), 413, "too-large")
    refused(http.post("/v1/jobs", json={"items": [{**WALK, "variants": 100}] * 1001}), 413, "too-large")
    refused(http.post("/v1/jobs", content=(b"x" * 2**20 for _ in range(70)), headers=headers), 413, "too-large")
    job = submit(http)
    refused(http.patch(f"/v1/jobs/{job['id']}", content=b" " * (2**20 + 1)), 413, "too-large")


def test_a_document_of_far_too_many_items_or_with_a_huge_one_is_refused(http: httpx2.Client) -> None:
    refused(http.post("/v1/jobs", content=b'{"items": [' + b"{}," * 2_000_000 + b"{}]}"), 413, "too-large")
    huge = b'{"prompt": "' + b"a" * 2**20 + b'"}'
    problem = refused(http.post("/v1/jobs", content=b'{"items": [' + huge + b"]}"), 413, "too-large")
    assert problem["where"] == "items, element 1"
    lines = {"Content-Type": "application/x-ndjson"}
    problem = refused(http.post("/v1/jobs", content=b"\n" + huge, headers=lines), 413, "too-large")
    assert problem["where"] == "line 2"


def test_a_long_body_that_cannot_be_kept_is_a_503_and_no_job(
    http: httpx2.Client, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = jobs_there(http)
    line = json.dumps({"prompt": "a person walks"}).encode() + b"\n"
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "unmounted"))
    problem = refused(
        http.post(
            "/v1/jobs", content=line * (IN_MEMORY // len(line) + 1), headers={"Content-Type": "application/x-ndjson"}
        ),
        503,
        "unreachable",
    )
    assert problem["where"] == "body"
    assert jobs_there(http) == before


def test_a_thousand_prompts_are_one_job(http: httpx2.Client) -> None:
    body = "\n".join(json.dumps({"prompt": f"a person walks {i} steps"}) for i in range(1000))
    response = http.post("/v1/jobs", content=body, headers={"Content-Type": "application/x-ndjson"})
    assert response.json()["total"] == 1000


# --- listings and operator verbs ---


def test_listings_are_paged_by_cursor(api: LiveApi, http: httpx2.Client) -> None:
    job = submit(http, *[{"prompt": f"a person walks {i} steps"} for i in range(7)])
    with api.client() as client:
        seen = [item["index"] for item in client.pages(f"/v1/jobs/{job['id']}/items", limit=3)]
    assert seen == list(range(7))
    refused(http.get("/v1/jobs", params={"cursor": "nonsense"}), 422, "invalid-input")
    problem = refused(http.get("/v1/jobs", params={"limit": 0}), 422, "invalid-input")
    assert problem["problems"][0]["field"] == "limit"


def test_an_operator_pauses_resumes_cancels_retries_changes_and_deletes(http: httpx2.Client) -> None:
    path = f"/v1/jobs/{submit(http)['id']}"
    assert http.post(f"{path}/pause").json()["state"] == "paused"
    assert http.post(f"{path}/resume").json()["state"] == "queued"
    assert http.patch(path, json={"priority": 9, "comment": "urgent"}).json()["comment"] == "urgent"
    assert http.patch(path, json={"comment": None}).json() == http.get(path).json()
    assert http.get(path).json()["priority"] == 9
    refused(http.patch(path, json={"priority": "high"}), 422, "invalid-input")
    refused(http.delete(path), 409, "conflict")
    assert http.post(f"{path}/cancel").json()["counters"]["cancelled"] == 1
    refused(http.post(f"{path}/pause"), 409, "conflict")
    assert http.post(f"{path}/retry").json()["counters"]["ready"] == 1
    http.post(f"{path}/cancel")
    assert http.delete(path).status_code == 204
    refused(http.get(path), 404, "not-found")


def test_a_failed_item_tells_why(api: LiveApi, http: httpx2.Client) -> None:
    job = submit(http, WALK, {"prompt": "a person dances badly"})
    api.work(fail=frozenset({"a person dances badly"}))
    found = http.get(f"/v1/jobs/{job['id']}").json()
    assert (found["state"], found["counters"]["failed"]) == ("partial", 1)
    failed = http.get(f"/v1/jobs/{job['id']}/items", params={"state": "failed"}).json()["items"]
    assert [item["error"]["message"] for item in failed] == ["this cannot be danced"]
    assert len(http.get(f"/v1/jobs/{job['id']}/motions").json()["items"]) == 1


# --- events ---


def test_events_are_pages_of_json(http: httpx2.Client) -> None:
    path = f"/v1/jobs/{submit(http)['id']}"
    http.post(f"{path}/pause")
    first = http.get(f"{path}/events", params={"limit": 1}).json()
    assert [event["seq"] for event in first["items"]] == [1]
    rest = http.get(f"{path}/events", params={"after": first["next"]}).json()
    assert [event["seq"] for event in rest["items"]] == list(range(2, 2 + len(rest["items"])))
    assert rest["next"] is None


def test_a_stream_follows_a_job_to_its_end_and_then_says_so(api: LiveApi, http: httpx2.Client) -> None:
    job = str(submit(http, *[{"prompt": f"a person walks {i} steps"} for i in range(5)])["id"])
    threading.Timer(0.3, api.work).start()
    with api.client() as client:
        events = list(client.events(job))
        assert events[-1]["data"]["state"] == "succeeded"
        seqs = [event["seq"] for event in events]
        assert seqs == sorted(set(seqs))
        assert list(client.events(job, after=seqs[-1])) == []
        middle = seqs[len(seqs) // 2]
        assert [e["seq"] for e in client.events(job, after=middle)] == [s for s in seqs if s > middle]
    sse = {"Accept": "text/event-stream", "Last-Event-ID": str(seqs[-1])}
    assert http.get(f"/v1/jobs/{job}/events", headers=sse).status_code == 204
    refused(http.get(f"/v1/jobs/{job}/events", headers={**sse, "Last-Event-ID": "x"}), 422, "invalid-input")


def test_a_stream_gives_at_most_two_progress_messages_a_second(api: LiveApi, http: httpx2.Client) -> None:
    job = str(submit(http, *[{"prompt": f"a person walks {i} steps"} for i in range(8)])["id"])
    threading.Thread(target=api.work, kwargs={"batch": 1, "pause": 0.15}).start()
    began = time.monotonic()
    with api.client() as client:
        messages = sum(event["kind"] == "progress" for event in client.events(job))
    assert 1 <= messages <= 2 * (time.monotonic() - began) + 1  # 8 items in 1.2 s would be 8


def test_many_open_streams_leave_the_api_answering(http: httpx2.Client) -> None:
    path = f"/v1/jobs/{submit(http)['id']}"
    with contextlib.ExitStack() as streams:
        for _ in range(60):  # more than the pool has connections
            opened = http.stream("GET", f"{path}/events", headers={"Accept": "text/event-stream"})
            assert streams.enter_context(opened).status_code == 200
        assert http.get(path).status_code == 200
    http.post(f"{path}/cancel")


def test_a_deleted_job_ends_its_streams(api: LiveApi, http: httpx2.Client) -> None:
    job = str(submit(http)["id"])
    with api.client() as client:
        events = client.events(job)
        assert next(events)["kind"] == "submitted"
        http.post(f"/v1/jobs/{job}/cancel")
        http.delete(f"/v1/jobs/{job}")
        with contextlib.suppress(NotFound):
            list(events)


# --- motions and files ---


@pytest.fixture(scope="module")
def content() -> bytes:
    return bytes(range(256)) * 20


@pytest.fixture(scope="module")
def motion(api: LiveApi, content: bytes) -> str:
    with api.http() as http:
        job = submit(http)
        api.work(content)
        return str(http.get(f"/v1/jobs/{job['id']}/motions").json()["items"][0]["id"])


def test_a_motion_tells_where_it_comes_from(http: httpx2.Client, motion: str, content: bytes) -> None:
    found = http.get(f"/v1/motions/{motion}").json()
    assert found["metadata"] == {"prompt": "a person walks", **METADATA}
    assert {f["format"]: f["sha256"] for f in found["files"]}["npz"] == hashlib.sha256(content).hexdigest()
    assert motion in [m["id"] for m in http.get("/v1/motions").json()["items"]]


def test_a_file_comes_whole_with_its_sha256_as_etag(http: httpx2.Client, motion: str, content: bytes) -> None:
    response = http.get(f"/v1/motions/{motion}/files/npz")
    etag = f'"{hashlib.sha256(content).hexdigest()}"'
    assert (response.status_code, response.content, response.headers["etag"]) == (200, content, etag)
    assert http.get(f"/v1/motions/{motion}/files/npz", headers={"If-None-Match": etag}).status_code == 304
    head = http.head(f"/v1/motions/{motion}/files/npz")
    assert (head.status_code, head.content) == (200, b"")
    for name in ("etag", "content-length", "content-type", "content-disposition", "accept-ranges"):
        assert head.headers[name] == response.headers[name]
    seed = http.get(f"/v1/motions/{motion}").json()["seed"]
    assert head.headers["content-disposition"] == f'attachment; filename="00000_a-person-walks_{seed}.npz"'
    assert http.head(f"/v1/motions/{motion}/files/xyz").status_code == 404
    refused(http.get(f"/v1/motions/{motion}/files/xyz"), 404, "not-found")
    refused(http.get(f"/v1/motions/{motion}/files/..%2f..%2fetc"), 404, "not-found")
    refused(http.get(f"/v1/motions/{uuid4()}/files/npz"), 404, "not-found")


@pytest.mark.parametrize(
    ("header", "start", "stop"),
    [("bytes=0-9", 0, 10), ("bytes=100-", 100, 5120), ("bytes=-20", 5100, 5120), ("bytes=5000-999999", 5000, 5120)],
)
def test_a_range_comes_as_206(
    http: httpx2.Client, motion: str, content: bytes, header: str, start: int, stop: int
) -> None:
    response = http.get(f"/v1/motions/{motion}/files/npz", headers={"Range": header})
    assert (response.status_code, response.content) == (206, content[start:stop])
    assert response.headers["content-range"] == f"bytes {start}-{stop - 1}/{len(content)}"


def test_a_range_past_the_end_is_416_and_a_senseless_one_is_ignored(
    http: httpx2.Client, motion: str, content: bytes
) -> None:
    path = f"/v1/motions/{motion}/files/npz"
    past = http.get(path, headers={"Range": "bytes=9999-"})
    assert (past.status_code, past.headers["content-range"]) == (416, f"bytes */{len(content)}")
    assert http.get(path, headers={"Range": "bytes=5-2"}).content == content
    assert http.get(path, headers={"Range": "bytes=0-1,4-5"}).content == content
    stale = http.get(path, headers={"Range": "bytes=0-9", "If-Range": '"other"'})
    assert (stale.status_code, stale.content) == (200, content)


# --- guards ---


def test_no_key_and_a_wrong_key_are_401(api: LiveApi) -> None:
    for headers in (
        {},
        {"Authorization": "Bearer marey_x_y"},
        {"Authorization": "Basic eDp5"},
    ):
        problem = refused(httpx2.get(f"{api.url}/v1/jobs", headers=headers), 401, "unauthenticated")
        assert problem["hint"]


def test_a_key_does_only_what_its_scopes_allow(api: LiveApi, http: httpx2.Client) -> None:
    job = submit(http)["id"]
    with api.http("read") as reader, api.http("submit") as submitter:
        assert reader.get(f"/v1/jobs/{job}").status_code == 200
        refused(reader.post("/v1/jobs", json={"items": [WALK]}), 403, "refused")
        refused(reader.post(f"/v1/jobs/{job}/cancel"), 403, "refused")
        submit(submitter)
        refused(submitter.get("/v1/jobs"), 403, "refused")


@pytest.mark.parametrize("host", ["evil.example", "", "127.0.0.1.evil.example", "[::2]:80"])
def test_a_foreign_host_is_refused(api: LiveApi, host: str) -> None:
    refused(httpx2.get(f"{api.url}/livez", headers={"Host": host}), 403, "refused")


@pytest.mark.parametrize("host", ["localhost", "LOCALHOST:8400", "[::1]:8400", "127.0.0.1"])
def test_the_names_of_this_machine_are_answered(api: LiveApi, host: str) -> None:
    assert httpx2.get(f"{api.url}/livez", headers={"Host": host}).text == "ok"


def test_unknown_paths_and_methods_are_problems(http: httpx2.Client) -> None:
    refused(http.get("/v2/jobs"), 404, "not-found")
    for method, path, allowed in (
        ("PUT", "/v1/jobs", "GET, POST"),
        ("PUT", f"/v1/jobs/{uuid4()}", "GET, PATCH, DELETE"),
        ("DELETE", f"/v1/motions/{uuid4()}/files/npz", "GET, HEAD"),
        ("OPTIONS", "/livez", "GET"),
    ):
        answer = http.request(method, path)
        problem = refused(answer, 405, "method-not-allowed")
        assert (answer.headers["allow"], problem["hint"]) == (allowed, f"Allowed: {allowed}.")
        assert (problem["where"], problem["detail"]) == (path, f"{method} is not a method of this path")
    problem = refused(http.get("/v1/jobs/not-a-uuid"), 422, "invalid-input")
    assert problem["problems"][0]["field"] == "job"


# --- models and health ---


def test_models_are_listed_with_their_terms(http: httpx2.Client) -> None:
    (model,) = http.get("/v1/models").json()["items"]
    assert (model["name"], model["licence"], model["max_seconds"]) == (BUNDLE, "MIT", 9.8)
    assert http.get("/v1/models/hgm3").json() == model
    assert http.get(f"/v1/models/{model['bundle']}").json() == model
    refused(http.get("/v1/models/stroller"), 404, "not-found")


def test_a_broken_bundle_is_told_without_a_path_and_hides_no_other(http: httpx2.Client, api_home: Path) -> None:
    broken = api_home / "models" / "broken"
    broken.mkdir()
    try:
        (broken / "manifest.json").write_text("{")
        answer = http.get("/v1/models")
        assert answer.status_code == 200, answer.text
        assert [model["name"] for model in answer.json()["items"]] == [BUNDLE]
        (told,) = answer.json()["broken"]
        assert told["name"] == "broken"
        assert told["reason"].startswith("manifest.json: is not JSON")
        asked = http.get("/v1/models/broken")
        refused(asked, 422, "invalid-bundle")
        assert str(api_home) not in answer.text + asked.text
    finally:
        shutil.rmtree(broken)


def test_readiness_waits_for_a_model_and_then_no_longer(api: LiveApi) -> None:
    def failing() -> list[str]:
        checks = httpx2.get(f"{api.url}/readyz").json()["checks"]
        return [name for name, check in checks.items() if not check["ok"]]

    wait_until(lambda: failing() == ["model"])
    assert httpx2.get(f"{api.url}/readyz").status_code == 503
    with transaction(api.engine) as conn:
        beat(conn, WorkerHeartbeat("w", "hgm3", "here", 1, "cpu", bundle=BUNDLE))
    wait_until(lambda: httpx2.get(f"{api.url}/readyz").json()["ready"])
    with transaction(api.engine) as conn:
        beat(conn, WorkerHeartbeat("w", "hgm3", "here", 1, "cpu"))
    assert httpx2.get(f"{api.url}/readyz").status_code == 200


def test_a_stalled_scheduler_is_told_and_leaves_the_api_ready(api: LiveApi) -> None:
    with transaction(api.engine) as conn:
        beat(conn, WorkerHeartbeat("w", "hgm3", "here", 1, "cpu", bundle=BUNDLE))
        record_scheduler_heartbeat(conn, "stalled", host="here", pid=1)
        conn.execute(sa.text("UPDATE worker SET seen_at = now() - interval '1 minute' WHERE id = 'stalled'"))
    wait_until(lambda: not httpx2.get(f"{api.url}/readyz").json()["checks"]["scheduler"]["ok"])
    wait_until(lambda: httpx2.get(f"{api.url}/readyz").json()["ready"])
    with transaction(api.engine) as conn:
        retire(conn, "stalled")
    wait_until(lambda: httpx2.get(f"{api.url}/readyz").json()["checks"]["scheduler"]["ok"])


def test_metrics_count_the_items_that_wait_by_queue(api: LiveApi, http: httpx2.Client) -> None:
    def waiting() -> float:
        lines = watcher.get("/metrics").text.splitlines()
        return sum(float(line.rpartition(" ")[2]) for line in lines if line.startswith("marey_waiting_items{"))

    with api.http("metrics") as watcher:
        before = waiting()
        submit(http, {"prompt": "a person waits"}, {"prompt": "a person waits longer"})
        assert waiting() == before + 2


def test_metrics_count_requests_by_route_and_want_a_key(api: LiveApi, http: httpx2.Client) -> None:
    http.get(f"/v1/jobs/{uuid4()}")
    with api.http("metrics") as watcher:
        text = watcher.get("/metrics").text
    assert 'marey_http_requests_total{method="GET",route="/v1/jobs/{job}",status="404"}' in text
    refused(httpx2.get(f"{api.url}/metrics"), 401, "unauthenticated")


def test_the_openapi_document_is_the_one_checked_in(http: httpx2.Client) -> None:
    found = http.get("/openapi.json").json()
    assert found["openapi"].startswith("3.1")
    checked_in = Path("docs/openapi.json").read_text(encoding="utf-8")
    made = json.dumps(found, indent=1, ensure_ascii=False) + "\n"
    assert made == checked_in, "make it anew: python -m marey.api docs/openapi.json"
