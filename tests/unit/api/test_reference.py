"""The OpenAPI document and its page: real ranges, examples that are accepted, and nothing from elsewhere."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import hypothesis
import pytest
from hypothesis import given
from hypothesis import strategies as st
from starlette.testclient import TestClient

import marey.api.docs
from marey.api.app import create_app
from marey.api.edits.schemas import NewEditBody
from marey.api.evaluations.schemas import NewEvaluationBody
from marey.api.jobs.schemas import JobPatch, NewJobBody
from marey.api.reference import EXAMPLES
from marey.api.schedules.schemas import NewScheduleBody, SchedulePatch
from marey.api.streams.schemas import EndStreamBody, NewStreamBody
from marey.api.takes.packs import NewPackBody
from marey.api.takes.schemas import NewRerollBody, NewReviewBody
from marey.api.webhooks.schemas import NewWebhookBody, WebhookPatch
from marey.core.characters import LINE_PATTERN, TEXT_PATTERN
from marey.core.settings import Settings
from marey.core.validation import meaning_of
from marey.http.fields import EXPECTED, ITEM_MODEL, ITEM_NAME, NAME_PATTERN, SAMPLING, TAG_PATTERN, TAGS
from marey.items.expected import read_expected
from marey.items.item import read_item
from marey.items.settings import BEST_OF, OUTPUT_FPS, REDRAWS
from marey.items.values import MAX_TAG_LENGTH
from marey.text_service.routes import ParseBody

BODIES = {
    model.__name__: model
    for model in (
        *(
            NewJobBody,
            JobPatch,
            NewReviewBody,
            NewRerollBody,
            NewPackBody,
            NewEditBody,
            NewStreamBody,
            EndStreamBody,
            ParseBody,
        ),
        *(NewEvaluationBody, NewScheduleBody, SchedulePatch, NewWebhookBody, WebhookPatch),
    )
}
ASSETS = Path(marey.api.docs.__file__).parent / "assets"
BOUNDS = {
    "integer": [("minimum", "exclusiveMinimum"), ("maximum", "exclusiveMaximum")],
    "number": [("minimum", "exclusiveMinimum"), ("maximum", "exclusiveMaximum")],
    "string": [("maxLength", "pattern", "enum", "format", "const")],
}


@pytest.fixture(scope="module")
def client() -> TestClient:
    return TestClient(create_app(Settings()), base_url="http://localhost")


@pytest.fixture(scope="module")
def document(client: TestClient) -> dict[str, Any]:
    return client.get("/openapi.json").json()


def without_bounds(
    schemas: dict[str, Any], schema: dict[str, Any], where: str, seen: tuple[str, ...] = ()
) -> Iterator[str]:
    """Numbers without a range and texts without a length, pattern or list of values, in a schema."""
    if "$ref" in schema:
        name = schema["$ref"].rpartition("/")[2]
        if name not in seen:
            yield from without_bounds(schemas, schemas[name], where, (*seen, name))
        return
    beside = {key: value for key, value in schema.items() if key not in ("anyOf", "oneOf", "type")}
    for one in [*schema.get("anyOf", []), *schema.get("oneOf", [])]:
        yield from without_bounds(schemas, {**one, **beside}, where, seen)
    for any_of in BOUNDS.get(schema.get("type", ""), []):
        if not any(name in schema for name in any_of):
            yield f"{where}: {any_of[0]}"
    if "items" in schema:
        yield from without_bounds(schemas, schema["items"], f"{where}[]", seen)
    for name, each in schema.get("properties", {}).items():
        yield from without_bounds(schemas, each, f"{where}.{name}", seen)


def patterns(schema: Any) -> Iterator[str]:
    """Patterns in a part of the document, at any depth."""
    if isinstance(schema, dict):
        if isinstance(schema.get("pattern"), str):
            yield schema["pattern"]
        for value in schema.values():
            yield from patterns(value)
    elif isinstance(schema, list):
        for value in schema:
            yield from patterns(value)


def test_every_pattern_is_told_in_words_where_a_text_does_not_match(document: dict[str, Any]) -> None:
    elsewhere = {LINE_PATTERN, TEXT_PATTERN, TAG_PATTERN, NAME_PATTERN, EXPECTED["pattern"], ITEM_MODEL["pattern"]}
    elsewhere.add(SAMPLING["propertyNames"]["pattern"])  # checks of our own refuse these
    found = set(patterns(document)) - elsewhere
    assert len(found) >= 5
    assert [pattern for pattern in found if meaning_of(pattern) is None] == []


def test_every_field_and_parameter_of_a_request_has_its_range(document: dict[str, Any]) -> None:
    found: list[str] = []
    for path, operations in document["paths"].items():
        for method, operation in operations.items():
            asked = {
                f"{p['in']} {p['name']}": p["schema"] for p in operation.get("parameters", []) if p["in"] != "header"
            }
            for media_type, content in operation.get("requestBody", {}).get("content", {}).items():
                asked[media_type] = content["schema"]
            for name, schema in asked.items():
                found += without_bounds(document["components"]["schemas"], schema, f"{method} {path} {name}")
    assert found == []


def test_ranges_are_those_of_the_checks(document: dict[str, Any]) -> None:
    item = document["components"]["schemas"]["NewItemBody"]["properties"]
    settings = item["settings"]
    fps, others = settings["properties"][OUTPUT_FPS], settings["additionalProperties"]
    whole = [(name, settings["properties"][name]) for name in (BEST_OF, REDRAWS)]
    for name, shown in ((OUTPUT_FPS, fps), ("guidance", others), *whole):
        low, high = shown["minimum"], shown["maximum"]
        for value, right in ((low, True), (high, True), (high * 1.1, False), (low - 1, False)):
            problems = read_item({"prompt": "walk", "settings": {name: value}})[1]
            assert (problems == []) is right
    pattern = re.compile(settings["propertyNames"]["pattern"])
    for name, right in (("guidance", True), ("top_k2", True), ("Guidance", False), ("a" * 41, False), ("", False)):
        assert (pattern.search(name) is not None) is right
        assert (read_item({"prompt": "walk", "settings": {name: 1}})[1] == []) is right
    for count in (settings["maxProperties"], settings["maxProperties"] + 1):
        many = {f"s{number}": 1 for number in range(count)}
        assert (read_item({"prompt": "walk", "settings": many})[1] == []) is (count == settings["maxProperties"])
    for length in (MAX_TAG_LENGTH, MAX_TAG_LENGTH + 1):
        allowed = length <= TAGS["items"]["maxLength"]
        assert (read_item({"prompt": "walk", "tags": ["x" * length]})[1] == []) is allowed


@pytest.mark.parametrize(
    ("field", "schema", "values"),
    [
        ("name", ITEM_NAME, ["greeting", "a (2)", "歩く", "a/b", "a\\b", "a\nb", "a\u202eb"]),
        ("model", ITEM_MODEL, ["hgm3", "hgm3-starter@0123456789ab", "../hgm3", "hgm3@x"]),
    ],
)
def test_patterns_take_what_the_check_takes(field: str, schema: dict[str, Any], values: list[str]) -> None:
    for value in values:
        accepted = read_item({"prompt": "walk", field: value})[1] == []
        assert bool(re.fullmatch(schema["pattern"], value)) is accepted, value


@given(
    st.text(st.sampled_from("aB1 ./\\\n\x7f-_(=é歩"), min_size=1, max_size=8)
    | st.from_regex(r"\A ?(con|PRN|Aux|nul|CONIN\$|conout\$|com[1¹]|LPT9)[ .a]{0,3}\Z")
)
@hypothesis.example("con")
@hypothesis.example("console")
@hypothesis.example(" a. ")
@hypothesis.example("a..b")
@hypothesis.example("=1")
def test_the_pattern_of_names_takes_what_the_check_takes(name: str) -> None:
    accepted = read_item({"prompt": "walk", "name": name})[1] == []
    assert bool(re.fullmatch(ITEM_NAME["pattern"], name)) is accepted


@given(st.text(st.sampled_from("a =;é\x1b"), min_size=1, max_size=5))
def test_the_pattern_of_tags_takes_what_the_check_takes(tag: str) -> None:
    accepted = read_item({"prompt": "walk", "tags": [tag]})[1] == []
    assert bool(re.fullmatch(TAGS["items"]["pattern"], tag)) is accepted


def test_the_pattern_of_what_is_expected_is_that_of_its_grammar() -> None:
    for text in ("walk", "walk straight then wave left", "bow then bow then bow then bow"):
        assert read_expected(text)
        assert re.fullmatch(EXPECTED["pattern"], text)
    for text in ("", "swim", "bow then", "bow then bow then bow then bow then bow"):
        assert not re.fullmatch(EXPECTED["pattern"], text)


def test_every_body_has_an_example_that_is_accepted(document: dict[str, Any]) -> None:
    shown = {}
    for operations in document["paths"].values():
        for operation in operations.values():
            for media_type, content in operation.get("requestBody", {}).get("content", {}).items():
                if content["schema"].get("format") != "binary":
                    shown[content["schema"]["$ref"].rpartition("/")[2], media_type] = content["example"]
    assert shown == EXAMPLES
    for (name, _), example in EXAMPLES.items():
        if name == "NewItemBody":
            assert read_item(example)[1] == []
        else:
            BODIES[name].model_validate_json(json.dumps(example))
    for example in EXAMPLES["NewJobBody", "application/json"]["items"]:
        assert read_item(example)[1] == []


def test_the_server_is_the_public_one_or_that_of_the_document(document: dict[str, Any]) -> None:
    assert document["servers"] == [{"url": "/"}]
    public = create_app(Settings(public_url="https://marey.example.com/")).openapi()
    assert public["servers"] == [{"url": "https://marey.example.com"}]


@pytest.mark.parametrize("path", ["/openapi.json", "/docs", "/docs/docs.js", "/live", "/"])
def test_a_query_that_is_not_known_is_refused_here_too(client: TestClient, path: str) -> None:
    assert client.get(path).status_code == 200
    answer = client.get(f"{path}?x=1")
    assert (answer.status_code, answer.json()["where"]) == (422, "x")


def test_the_page_of_the_docs_loads_its_own_files_alone(client: TestClient) -> None:
    page = client.get("/docs")
    policy = page.headers["content-security-policy"]
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy
    assert "://" not in page.text
    assert "<style" not in page.text
    for link in re.findall(r'(?:src|href)="([^"]+)"', page.text):
        if not link.startswith("data:"):
            answer = client.get(f"/{link}")
            assert answer.status_code == 200
            again = client.get(f"/{link}", headers={"If-None-Match": answer.headers.get("etag", "")})
            assert again.status_code == (304 if "etag" in answer.headers else 200)


def test_vendored_files_are_those_of_the_note() -> None:
    noted = re.findall(r"^\| `(\S+)` \| `([0-9a-f]{64})` \|$", (ASSETS / "README.md").read_text(), re.MULTILINE)
    assert {name for name, _ in noted} == {"swagger-ui-bundle.js", "swagger-ui.css"}
    for name, sha256 in noted:
        assert hashlib.sha256((ASSETS / name).read_bytes()).hexdigest() == sha256
