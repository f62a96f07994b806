"""Many at once at one API process: more than it has threads and connections to the database."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import httpx2
import pytest

from shared.runtime.embedded import EmbeddedServer
from tests.support.live_api import LiveApi, running_api, settings_of

REQUESTS = 80
"""Twice the threads of a process, four times its connections."""
FOLLOWERS = 50


@pytest.fixture(scope="module")
def api(
    module_database_url: str, valkey: EmbeddedServer, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[LiveApi]:
    config = settings_of(tmp_path_factory.mktemp("api"), module_database_url, valkey.url)
    with running_api(config, module_database_url) as api:
        yield api


def test_more_requests_at_once_than_connections_are_all_answered(api: LiveApi) -> None:
    with api.client() as client:
        job = client.submit([{"prompt": "a person walks"}])["id"]
    paths = (f"/v1/jobs/{job}", f"/v1/jobs/{job}/items", "/v1/jobs", "/v1/motions")
    together = threading.Barrier(REQUESTS)
    headers = {"Authorization": f"Bearer {api.key}"}
    limits = httpx2.Limits(max_connections=REQUESTS)

    with httpx2.Client(base_url=api.url, headers=headers, timeout=60, limits=limits) as http:

        def ask(number: int) -> int:
            together.wait(60)
            return http.get(paths[number % len(paths)]).status_code

        with ThreadPoolExecutor(REQUESTS) as pool:
            assert set(pool.map(ask, range(REQUESTS))) == {200}


def test_all_who_follow_a_job_are_told_the_same_from_where_each_stands(api: LiveApi) -> None:
    with api.client() as client:
        job = client.submit([{"prompt": "a person bows"}])["id"]
        paused = client.post(f"/v1/jobs/{job}/pause")["event_seq"]
        opened = threading.Barrier(FOLLOWERS + 1)

        def follow(number: int) -> list[int]:
            after = number % (paused + 1)  # some have seen nothing yet, some all that stands
            seen: list[int] = []
            with client.stream(f"/v1/jobs/{job}/events", {**SSE, "Last-Event-ID": str(after)}, patience=60) as response:
                opened.wait(60)
                seen.extend(int(line[4:]) for line in response.iter_lines() if line.startswith("id: "))
            assert seen == list(range(after + 1, seen[-1] + 1))
            return seen

        with ThreadPoolExecutor(FOLLOWERS) as pool:
            told = [pool.submit(follow, number) for number in range(FOLLOWERS)]
            opened.wait(60)
            last = client.post(f"/v1/jobs/{job}/cancel")["event_seq"]
            assert {seen.result(60)[-1] for seen in told} == {last}


SSE = {"Accept": "text/event-stream"}
