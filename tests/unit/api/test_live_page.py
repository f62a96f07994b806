"""`GET /live`: how the page is answered."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from fastapi import FastAPI
from starlette.testclient import TestClient

import marey.api.live
from marey.api.catalogue import Catalogue
from marey.api.live.routes import MOST_EXAMPLES, router
from marey.bundles import find_bundle
from marey.checks.prompts import evaluation_prompts
from marey.core.settings import Settings
from marey.models.mogo.examples import LEAST, SETS, act_of
from marey.viz.live_page import live_page


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> TestClient:
    models = tmp_path_factory.mktemp("models")
    app = FastAPI()
    app.include_router(router)
    app.state.catalogue = Catalogue(Settings(models=models))
    return TestClient(app, base_url="http://studio.example:8000")


def test_the_page_comes_without_a_key_and_with_its_policy(client: TestClient):
    answer = client.get("/live")
    assert answer.status_code == 200
    assert answer.content == live_page().content
    assert answer.headers["content-type"] == "text/html; charset=utf-8"
    assert answer.headers["content-security-policy"] == live_page().policy("studio.example:8000")
    assert answer.headers["x-content-type-options"] == "nosniff"
    assert answer.headers["referrer-policy"] == "no-referrer"
    assert answer.headers["cache-control"] == "no-cache"


def test_a_browser_that_has_the_page_does_not_get_it_again(client: TestClient):
    etag = client.get("/live").headers["etag"]
    answer = client.get("/live", headers={"If-None-Match": etag})
    assert (answer.status_code, answer.content) == (304, b"")
    assert answer.headers["content-security-policy"] == live_page().policy("studio.example:8000")
    assert client.get("/live", headers={"If-None-Match": '"another"'}).status_code == 200


def test_the_page_is_no_part_of_the_api_document(client: TestClient):
    assert client.get("/openapi.json").json()["paths"] == {}


def test_examples_are_prompts_that_the_bundle_was_measured_to_obey() -> None:
    app = FastAPI()
    app.include_router(router)
    app.state.catalogue = Catalogue(Settings())
    page = TestClient(app).get("/live").text
    found = re.search(r'<script type="application/json" id="suggested">(.*?)</script>', page)
    assert found is not None
    offered = json.loads(found[1])
    measured = json.loads((Path(marey.api.live.__file__).parent / "examples.json").read_text())
    rows = {row["prompt"]: row for row in measured[find_bundle("mogo-starter").reference]}
    assert 3 <= len(offered) <= MOST_EXAMPLES
    for prompt in offered:
        row = rows[prompt]
        assert row["obeyed"] >= LEAST * row["sessions"]
        assert row["sessions"] >= 6
    prompts = {each.text: each for which in SETS for each in evaluation_prompts(which)}
    acts = [act_of(prompts[prompt]) for prompt in offered]
    assert len(set(acts)) == len(acts)
    assert not any(prompts[prompt].separate for prompt in offered)


def test_a_bundle_that_was_not_measured_has_no_examples(client: TestClient) -> None:
    assert '<script type="application/json" id="suggested">[]</script>' in client.get("/live").text
