"""`GET /live`: how the page is answered."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from fastapi import FastAPI
from starlette.testclient import TestClient

from marey.api.catalogue import Catalogue
from marey.api.live.routes import MOST_EXAMPLES, examples, router
from marey.core.settings import Settings
from marey.viz.live_page import live_page
from tests.support.live_api import write_bundle
from tests.support.plugins import installed, write_distribution


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


DANCER = """\
from marey.registry import ModelSpec
SPEC = ModelSpec("dancer", "", "", handler="a:b", load="a:b", live="a:b", live_examples="dancer_live:examples")
def examples(reference):
    return ["a person dances"] * 9 if reference.startswith("measured@") else []
"""


@pytest.mark.parametrize(("bundle", "offered"), [("measured", ["a person dances"] * MOST_EXAMPLES), ("new", [])])
def test_examples_are_those_of_the_bundle_that_streams(tmp_path: Path, bundle: str, offered: list[str]) -> None:
    entries = "[marey.models]\ndancer = dancer_live:SPEC\n"
    write_bundle(tmp_path / "models", bundle, "dancer")
    app = FastAPI()
    app.include_router(router)
    app.state.catalogue = Catalogue(Settings(home=tmp_path, models=tmp_path / "models"))
    with installed(write_distribution(tmp_path, "dancer", {"dancer_live": DANCER}, entries)):
        page = TestClient(app).get("/live").text
    found = re.search(r'<script type="application/json" id="suggested">(.*?)</script>', page)
    assert (json.loads(found[1]) if found else []) == offered


def test_a_server_without_a_bundle_that_streams_offers_none(tmp_path: Path) -> None:
    assert examples(Catalogue(Settings(home=tmp_path, models=tmp_path))) == ()
