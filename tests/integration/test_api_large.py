"""Large bodies: read piece by piece, within a bounded room, and never at the cost of small requests."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator
from pathlib import Path

import httpx2
import pytest
from fastapi import FastAPI

from marey.api.app import create_app
from marey.client.server_address import Server
from marey.client.transport import Transport
from marey.core.spool import IN_MEMORY
from marey.db import create_engine, transaction
from marey.embedded import EmbeddedServer
from marey.http.body_budget import BodyBudget
from marey.tenants import create_key
from tests.support.live_api import ApiThread, settings_of, wait_until
from tests.support.raw_http import RawClient

SIZE = 2 * IN_MEMORY
ITEMS = 3000


@pytest.fixture
def app(module_database_url: str, valkey: EmbeddedServer, tmp_path: Path) -> Iterator[tuple[FastAPI, str, str]]:
    """An API with room for one large body, its URL and a key."""
    config = settings_of(tmp_path, module_database_url, valkey.url)
    engine = create_engine(module_database_url)
    with transaction(engine) as conn:
        key = create_key(conn, "large", ["admin"]).secret
    engine.dispose()
    app = create_app(config)
    with ApiThread(config, app) as url:
        app.state.context.body_budget = BodyBudget(SIZE, SIZE, seconds=0.2)
        yield app, url, key


def items() -> list[dict[str, str]]:
    filler = "and then turns to the left " * 20
    return [{"prompt": f"a person walks {number} steps {filler}"} for number in range(ITEMS)]


def head(key: str, length: int) -> bytes:
    lines = ["POST /v1/jobs HTTP/1.1", "Host: 127.0.0.1", f"Authorization: Bearer {key}", f"Content-Length: {length}"]
    return "\r\n".join([*lines, "Content-Type: application/json", "", ""]).encode()


def test_a_large_body_waits_is_refused_and_is_taken_once_there_is_room(app: tuple[FastAPI, str, str]) -> None:
    api, url, key = app
    room = api.state.context.body_budget
    headers = {"Authorization": f"Bearer {key}"}
    body = json.dumps({"items": items()})
    assert IN_MEMORY < len(body) <= SIZE
    with httpx2.Client(base_url=url, headers=headers, timeout=60) as http:
        with RawClient(url) as holder:
            holder.send(head(key, SIZE) + b" " * 1000)
            wait_until(lambda: room.used == SIZE)
            refused = http.post("/v1/jobs", content=body, headers={"Content-Type": "application/json"})
            assert refused.status_code == 503
            assert refused.json()["type"] == "urn:marey:problem:overloaded"
            assert int(refused.headers["Retry-After"]) >= 1
            unsized = http.post("/v1/jobs", content=(body[at : at + 2**16].encode() for at in range(0, SIZE, 2**16)))
            assert unsized.status_code == 503, "what does not say its length needs room once it is long"
            small = http.post("/v1/jobs", json={"items": items()[:2]})
            assert small.status_code == 202
            with Transport(Server(url, key)) as client:
                submitted: list[str] = []
                waiting = threading.Thread(target=lambda: submitted.append(client.submit(items())["id"]))
                waiting.start()
                waiting.join(0.5)
                assert not submitted
                holder.__exit__()  # it leaves in the middle
                waiting.join(60)
                assert submitted
                assert client.get(f"/v1/jobs/{submitted[0]}")["total"] == ITEMS
        wait_until(lambda: room.used == 0)
        taken = http.post("/v1/jobs", content=body, headers={"Content-Type": "application/json"})
        assert (taken.status_code, taken.json()["total"]) == (202, ITEMS)
        assert room.used == 0


def test_a_document_is_the_job_that_its_lines_are(app: tuple[FastAPI, str, str]) -> None:
    _, url, key = app
    given = [{**item, "seed": number, "tags": ["crowd"]} for number, item in enumerate(items()[:40])]
    headers = {"Authorization": f"Bearer {key}"}
    with httpx2.Client(base_url=url, headers=headers, timeout=60) as http:
        job = http.post("/v1/jobs", json={"items": given, "name": "one"}).json()
        lines = "\n".join(map(json.dumps, given))
        other = http.post("/v1/jobs?name=one", content=lines, headers={"Content-Type": "application/x-ndjson"}).json()
        found = [http.get(f"/v1/jobs/{each['id']}/items").json()["items"] for each in (job, other)]
        told = [[(row["prompt"], row["seed"], row["index"]) for row in rows] for rows in found]
        assert told[0] == told[1]
        assert job["name"] == other["name"] == "one"
        wrong = [{**given[0]}, {"prompt": ""}, {"prompt": "walk", "seconds": 99}]
        problems = http.post("/v1/jobs", json={"items": wrong}).json()["problems"]
        lines = "\n".join(map(json.dumps, wrong))
        same = http.post("/v1/jobs", content=lines, headers={"Content-Type": "application/x-ndjson"}).json()["problems"]
        assert problems == same
        assert [problem["line"] for problem in problems] == [2, 3]
