"""Many at once at one API process: more than it has threads and connections to the database."""

from __future__ import annotations

import threading
from concurrent.futures import ThreadPoolExecutor

import httpx2

from tests.support.live_api import LiveApi

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


SSE = {"Accept": "text/event-stream"}
