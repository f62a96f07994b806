"""Many at once at one API process: more than it has threads and connections to the database."""

from __future__ import annotations

import threading
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path

import httpx2
import pytest

from marey.cli.watching import watch_job
from marey.client import Client
from marey.client.transport import Transport
from marey.core.errors import Busy
from marey.embedded import EmbeddedServer
from tests.support.live_api import LiveApi, running_api, settings_of, wait_until

REQUESTS = 80
"""Twice the threads of a process, four times its connections."""
FOLLOWERS = 50


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


def test_a_key_that_follows_all_it_may_is_told_to_come_back_and_others_are_let_in(
    module_database_url: str, valkey: EmbeddedServer, tmp_path: Path
) -> None:
    config = settings_of(tmp_path, module_database_url, valkey.url)
    config = config.model_copy(update={"event_streams_per_key": 2, "event_streams_per_tenant": 3})
    with running_api(config, module_database_url) as api, api.client() as client:
        job = client.submit([{"prompt": "a person nods"}])["id"]
        path = f"/v1/jobs/{job}/events"
        with ExitStack() as stack:
            for _ in range(2):
                stack.enter_context(client.stream(path, SSE))
            with pytest.raises(Busy, match="this key has 2 event streams open") as refused, client.stream(path, SSE):
                pass
            assert refused.value.seconds >= 1
            with api.http("read") as other, other.stream("GET", path, headers=SSE) as answer:
                assert answer.status_code == 200
                with api.http("read") as third:
                    assert third.get(path, headers=SSE).status_code == 429, "the tenant has its share"
            assert client.get("/v1/jobs", limit=1)["items"], "only streams are counted"
        wait_until(lambda: _opens(client, path))
        watching = threading.Timer(0.5, lambda: client.post(f"/v1/jobs/{job}/cancel"))
        with client.stream(path, SSE), client.stream(path, SSE):
            watching.start()
            assert watch_job(Client(client.server), job, quiet=True).state == "cancelled", (
                "it looks instead of following"
            )


def _opens(client: Transport, path: str) -> bool:
    try:
        with client.stream(path, SSE):
            return True
    except Busy:
        return False


SSE = {"Accept": "text/event-stream"}
