"""An answer that refuses what was sent names the field: where it is no field that schemathesis could find."""

from __future__ import annotations

import re
from collections.abc import Iterator
from uuid import uuid4

import httpx2
import pytest

from marey.embedded import EmbeddedServer
from tests.support.document import openapi
from tests.support.evaluations import GENERATOR, JUDGE, write_evaluator, write_generator
from tests.support.live_api import running_api, settings_of

JSON = {"Content-Type": "application/json"}
NOBODY = "00000000-0000-0000-0000-000000000000"
AN_ID = "an id such as 01234567-89ab-cdef-0123-456789abcdef"
PROMPTS = [{"prompt": "walk"}, {"prompt": "run"}]
BROKEN = {
    "no JSON": b'{"prompt": ',
    "no UTF-8": b'{"prompt": "\xff"}',
    "nested too deeply": b"[" * 200_000,
    "no object": b"[1]",
    "a number without end": b'{"priority": ' + b"1" * 5000 + b"}",
}
SAID = {
    "no UTF-8": "the body is not UTF-8 (byte 0xff at position 12)",
    "nested too deeply": "the body is nested too deeply",
    "a number without end": "the body holds a number of too many digits",
}
WITH_BODY = ("/v1/jobs", "/v1/evaluations", "/v1/schedules", "/v1/streams", "/v1/webhooks", "/v1/texts/parse")


@pytest.fixture(scope="module")
def http(
    module_database_url: str, valkey: EmbeddedServer, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[httpx2.Client]:
    config = settings_of(tmp_path_factory.mktemp("api"), module_database_url, valkey.url)
    write_generator(config.models)
    with running_api(config, module_database_url) as api, api.http() as http:
        missing = http.post("/v1/evaluations", json={"bundle": GENERATOR, "prompts": PROMPTS})
        assert refusal(missing) == (422, "evaluator")  # there is none yet
        write_evaluator(config.models)
        yield http


def refusal(response: httpx2.Response) -> tuple[int, str]:
    """The status, and what the problem is about."""
    assert "/" not in response.json().get("where", ""), response.text  # paths of the server are not revealed
    return response.status_code, response.json()["where"]


@pytest.mark.parametrize("path", WITH_BODY)
@pytest.mark.parametrize("broken", BROKEN)
def test_of_a_body_that_cannot_be_read_the_body_is_named(http: httpx2.Client, path: str, broken: str) -> None:
    answer = http.post(path, content=BROKEN[broken], headers=JSON)
    assert refusal(answer) == (422, "body")
    assert SAID.get(broken, "") in answer.json()["detail"]


@pytest.mark.parametrize(
    ("method", "path"),
    [
        *(("POST", path) for path in WITH_BODY),
        ("POST", "/v1/motions/files"),
        ("POST", "/v1/motions/review"),
        ("POST", "/v1/motions/reroll"),
        ("POST", f"/v1/motions/{NOBODY}/edits"),
        ("POST", f"/v1/streams/{NOBODY}/end"),
        ("PATCH", f"/v1/jobs/{NOBODY}"),
        ("PATCH", f"/v1/webhooks/{NOBODY}"),
        ("PATCH", f"/v1/schedules/{NOBODY}"),
    ],
)
def test_a_body_that_gives_a_key_twice_is_refused(http: httpx2.Client, method: str, path: str) -> None:
    answer = http.request(method, path, content=b'{"name": "a", "name": "b"}', headers=JSON)
    assert answer.status_code == 422
    assert "twice" in answer.json()["detail"], answer.text


def test_of_lines_without_a_prompt_the_body_is_named(http: httpx2.Client) -> None:
    assert refusal(http.post("/v1/jobs", content=b"\n \n", headers={"Content-Type": "application/x-ndjson"})) == (
        422, "body",
    )  # fmt: skip


@pytest.mark.parametrize(
    ("method", "path", "sent", "field", "message"),
    [
        (
            *("POST", "/v1/motions/files", {"motions": [NOBODY], "formats": ["../x"]}, "formats.0"),
            "'../x' cannot be used: allowed are names of formats, as npz, bvh, glb or mp4",
        ),
        ("POST", "/v1/motions/review", {"motions": [], "verdict": "kept"}, "motions", "is empty"),
        ("POST", "/v1/motions/review", {"motions": ["walk"], "verdict": None}, "motions.0", f"'walk' is not {AN_ID}"),
        (
            *("POST", "/v1/motions/review", {"motions": [NOBODY], "verdict": "Kept"}, "verdict"),
            "'Kept' is not known (did you mean 'kept'?); known: kept, rejected",
        ),
        (
            *("POST", "/v1/motions/reroll", {"motions": [NOBODY] * 1001}, "motions"),
            "has 1,001 elements: at most 1,000 are allowed",
        ),
        ("POST", f"/v1/motions/{NOBODY}/edits", {"ops": []}, "ops", "is empty"),
        ("POST", f"/v1/motions/{NOBODY}/edits", {"ops": ["loop"]}, "ops.0", "'loop' is not an object"),
        (
            *("POST", f"/v1/motions/{NOBODY}/edits", {"ops": [{"op": "loop"}], "model": "../x"}, "model"),
            "'../x' cannot be used: allowed are names of models and bundles: `marey models list` shows them",
        ),
        ("POST", "/v1/jobs", {"priority": 1001}, "priority", "1001 is above 1,000, the most that is allowed"),
        ("POST", "/v1/jobs", {"priority": "high"}, "priority", "'high' is not a whole number"),
        ("POST", "/v1/jobs", {"scope": "never"}, "scope", "'never' is not known; known: warn, refuse, ignore"),
        ("POST", "/v1/jobs", {"name": "x" * 201}, "name", "has 201 characters: at most 200 are allowed"),
        ("PATCH", f"/v1/jobs/{NOBODY}", {"fail_early": -1}, "fail_early", "-1 is below 0, the least that is allowed"),
        ("POST", "/v1/evaluations", {"repeats": [1]}, "repeats", "is a list, not a whole number"),
        (
            *("PATCH", f"/v1/schedules/{NOBODY}", {"request": {"bundle": GENERATOR, "split": "test", "sed": 3}}, "sed"),
            "is not a known field (did you mean 'seed'?); known: bundle, evaluator, split, source, settings, repeats,",
        ),
        ("POST", "/v1/webhooks", {}, "url", "is missing"),
        ("POST", "/v1/texts/parse", {"prompts": []}, "prompts", "is empty"),
        ("GET", "/v1/jobs?limit=0", None, "limit", "0 is below 1, the least that is allowed"),
        ("GET", "/v1/motions?tag=", None, "tag", "is empty"),
        (
            *("POST", "/v1/rigs?name=h%C3%A9ro&format=bvh", None, "name"),
            "'héro' cannot be used: allowed are letters from A to Z, digits, _ and -, at most 63, of which the first",
        ),
    ],
)
def test_a_wrong_value_is_told_in_our_words(
    http: httpx2.Client, method: str, path: str, sent: dict[str, object] | None, field: str, message: str
) -> None:
    if path == "/v1/jobs" and sent is not None:
        sent = {"items": PROMPTS, **sent}
    elif path == "/v1/evaluations" and sent is not None:
        sent = {"bundle": GENERATOR, "prompts": PROMPTS, **sent}
    answer = http.request(method, path, json=sent)
    told = {each["field"]: each["message"] for each in answer.json()["problems"]}
    assert answer.status_code == 422
    assert told[field].startswith(message)


def test_of_too_many_items_the_first_that_is_one_too_many_is_named(http: httpx2.Client) -> None:
    assert refusal(http.post("/v1/jobs", json={"items": [{}] * 100_001})) == (413, "line 100001")


def test_a_bundle_of_the_wrong_kind_or_of_nobody_is_told_by_the_field_that_names_it(http: httpx2.Client) -> None:
    assert refusal(http.get(f"/v1/models/{JUDGE}")) == (422, "name")
    assert refusal(http.post("/v1/texts/parse", json={"prompts": ["walk"], "model": "nobody"})) == (
        404,
        "model",
    )
    for model in (JUDGE, "nobody", GENERATOR):
        assert refusal(http.post("/v1/streams", json={"prompt": "walk", "model": model})) == (422, "model")
    for path, more in (("/v1/evaluations", {}), ("/v1/schedules", {"cron": "0 3 * * 1"})):
        for field, name in (("bundle", JUDGE), ("bundle", "nobody"), ("evaluator", GENERATOR), ("evaluator", "nobody")):
            body = {"bundle": GENERATOR, "prompts": PROMPTS, **more, field: name}
            assert refusal(http.post(path, json=body)) == (422, field)


def test_a_query_parameter_that_is_not_known_is_named_by_every_operation(http: httpx2.Client) -> None:
    paths = openapi()["paths"]
    del paths["/metrics"]  # which wants a scope that this key lacks, and that is told first
    for template, operations in paths.items():
        path = re.sub(r"{\w+}", lambda _: str(uuid4()), template)
        for method in operations:
            assert refusal(http.request(method, path, params={"nonsense": "1"})) == (422, "nonsense"), (
                method,
                template,
            )


def test_a_parameter_of_one_value_is_given_once(http: httpx2.Client) -> None:
    assert refusal(http.get("/v1/jobs?limit=5&limit=6")) == (422, "limit")
    assert refusal(http.get(f"/v1/motions/{NOBODY}/files/bvh?fps=30&fps=60")) == (422, "fps")
    assert http.get("/v1/motions?tag=a&tag=b&review=kept&review=new").status_code == 200
    assert http.get("/v1/jobs?state=queued&state=failed").status_code == 200


def test_a_misspelt_filter_is_told_with_those_there_are(http: httpx2.Client) -> None:
    response = http.get("/v1/motions", params={"tags": "show=zzz"})
    assert refusal(response) == (422, "tags")
    assert "tag, text" in response.json()["detail"]
    assert http.get("/v1/motions", params={"tag": "show=zzz"}).json()["items"] == []
