"""`GET /live`: how the page is answered."""

from __future__ import annotations

import pytest
from fastapi import FastAPI
from starlette.testclient import TestClient

from services.api.live.routes import router
from shared.motion.live_page import live_page


@pytest.fixture(scope="module")
def client() -> TestClient:
    app = FastAPI()
    app.include_router(router)
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
