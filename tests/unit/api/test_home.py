"""`GET /`: what a person finds who opens the address of the API."""

from __future__ import annotations

import re

import pytest
from starlette.testclient import TestClient

from marey.api.app import create_app
from marey.core.settings import Settings


@pytest.fixture(scope="module")
def client() -> TestClient:
    return TestClient(create_app(Settings()), base_url="http://localhost")


def test_the_page_wants_no_key_and_loads_nothing(client: TestClient) -> None:
    answer = client.get("/")
    assert answer.status_code == 200
    assert answer.headers["content-type"] == "text/html; charset=utf-8"
    assert answer.headers["content-security-policy"].startswith("default-src 'none'")
    assert "http://" not in answer.text
    assert "https://" not in answer.text
    assert "marey admin keys create" in answer.text


def test_what_it_leads_to_is_there(client: TestClient) -> None:
    links = re.findall(r'<a href="([^"]+)"', client.get("/").text)
    assert {"live", "openapi.json"} <= set(links)
    known = {"/live", "/docs", "/openapi.json", *client.get("/openapi.json").json()["paths"]}
    assert {f"/{link}" for link in links} <= known
    assert client.get("/live").status_code == client.get("/docs").status_code == 200
