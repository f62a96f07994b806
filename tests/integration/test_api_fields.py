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


def test_of_lines_without_a_prompt_the_body_is_named(http: httpx2.Client) -> None:
    assert refusal(http.post("/v1/jobs", content=b"\n \n", headers={"Content-Type": "application/x-ndjson"})) == (
        422, "body",
    )  # fmt: skip


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


def test_a_misspelt_filter_is_told_with_those_there_are(http: httpx2.Client) -> None:
    response = http.get("/v1/motions", params={"tags": "show=zzz"})
    assert refusal(response) == (422, "tags")
    assert "tag, text" in response.json()["detail"]
    assert http.get("/v1/motions", params={"tag": "show=zzz"}).json()["items"] == []
