"""Parsing beside generation: what 45 parallel parses do to the API, and how long one request takes alone.

`marey serve` runs with the shipped model; one worker generates all the time on the same cores. Bars: p99 of `/livez`
under 100 ms and of `GET /v1/jobs` under 2 s while 45 clients parse 16 long prompts each (429 is an answer that they
wait after), and p95 of one request of 16 prompts at most 1 s.
"""

from __future__ import annotations

import shutil
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

import httpx2

from benchmarks.bench_text import LONG
from benchmarks.platform import marey
from marey.client.server_address import Server, read_server
from marey.client.transport import Transport
from marey.core.errors import MareyError
from tests.support.marey import REPOSITORY, Marey

CLIENTS, PROMPTS, REPEATS = 45, 16, 40
BARS = {"/livez, p99": 100, "/readyz, p99": 100, "GET /v1/jobs, p99": 2000, "one request of 16 prompts, p95": 1000}
"""Milliseconds."""
READY_SECONDS = 300.0
GENERATED = 4000
"""Items of the job that runs beside: more than are made meanwhile."""


@dataclass(frozen=True)
class Crowd:
    """Outcome of the parallel requests."""

    seconds: float
    parsed: int
    refused: int


def main() -> None:
    """Print each bar."""
    with _server() as server, Transport(server) as client:
        prompts = [f"a person walks {number} steps and then waves" for number in range(GENERATED)]
        job = client.submit([{"prompt": prompt, "model": "hgm3"} for prompt in prompts])["id"]
        _until(lambda: client.get(f"/v1/jobs/{job}")["counters"]["succeeded"] > 0, "the worker generates")
        alone = [_parse(client, number) for number in range(REPEATS + 3)][3:]
        probes = {"/livez, p99": "/livez", "/readyz, p99": "/readyz", "GET /v1/jobs, p99": "/v1/jobs?limit=50"}
        with _Probes(server, probes) as probing, ProcessPoolExecutor(1, get_context("spawn")) as pool:
            crowd = pool.submit(_crowd, server).result()
        found = {name: 1e3 * _quantile(times, 99) for name, times in probing.times.items()}
        found["one request of 16 prompts, p95"] = 1e3 * _quantile(alone, 95)
        state = client.get(f"/v1/jobs/{job}")
        assert state["state"] == "running", "the worker had nothing left to do"
        client.post(f"/v1/jobs/{job}/cancel")
    print(f"{CLIENTS} clients of {PROMPTS} prompts of {len(_long(0).split())} words, beside a worker that generates:")
    print(f"{crowd.parsed} parsed, {crowd.refused} given up after three minutes of 429, in {crowd.seconds:.0f} s.\n")
    print("| what | measured | bar | |")
    print("|---|---|---|---|")
    for name, value in found.items():
        print(f"| {name} | {value:.0f} ms | <= {BARS[name]} ms | {'met' if value <= BARS[name] else 'MISSED'} |")
    print(f"\nOne request of {PROMPTS} prompts of {len(LONG.split())} words, median of {REPEATS}:")
    print(f"{1e3 * statistics.median(alone):.0f} ms.")


def _long(number: int) -> str:
    """A prompt as long as a careful author writes: three sentences."""
    return f"{LONG}. then {LONG}, {number} times. after that {LONG}"


def _parse(client: Transport, number: int) -> float:
    began = time.perf_counter()
    client.post("/v1/texts/parse", {"prompts": [f"{LONG} {number} {each}" for each in range(PROMPTS)]})
    return time.perf_counter() - began


def _crowd(server: Server) -> Crowd:
    """All at once, in a process of their own: threads of the one that measures would delay what it sees."""

    def ask(number: int) -> bool:
        with Transport(server) as client:
            try:
                client.post("/v1/texts/parse", {"prompts": [_long(100 * number + each) for each in range(PROMPTS)]})
            except MareyError:
                return False
            return True

    began = time.perf_counter()
    with ThreadPoolExecutor(CLIENTS) as pool:
        parsed = list(pool.map(ask, range(CLIENTS)))
    return Crowd(time.perf_counter() - began, sum(parsed), CLIENTS - sum(parsed))


def _quantile(times: list[float], percent: int) -> float:
    return statistics.quantiles(times, n=100, method="inclusive")[percent - 1]


def _until(happened: Callable[[], bool], what: str) -> None:
    deadline = time.monotonic() + READY_SECONDS
    while not happened():
        assert time.monotonic() < deadline, f"{what} too late"
        time.sleep(0.5)


class _Probes:
    """Asks each path again and again, each from a thread and a connection of its own."""

    def __init__(self, server: Server, paths: dict[str, str]) -> None:
        self.times: dict[str, list[float]] = {name: [] for name in paths}
        self._server, self._stopping = server, threading.Event()
        self._threads = [threading.Thread(target=self._run, args=each) for each in paths.items()]

    def __enter__(self) -> _Probes:
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stopping.set()
        for thread in self._threads:
            thread.join()

    def _run(self, name: str, path: str) -> None:
        headers = {"Authorization": f"Bearer {self._server.key}"}
        with httpx2.Client(base_url=self._server.url, headers=headers, timeout=120) as http:
            while not self._stopping.wait(0.03):
                began = time.perf_counter()
                http.get(path)
                self.times[name].append(time.perf_counter() - began)


@contextmanager
def _server() -> Iterator[Server]:
    """`marey serve` on a home of its own, ready, its text service too."""
    home = Path(tempfile.mkdtemp(prefix="marey-"))
    environment = {**Marey(home, REPOSITORY / "models").environ(), "MAREY_THREADS": "0"}
    environment.pop("OMP_NUM_THREADS")
    command = marey("serve", "--port", "0", "--with", "hgm3+text")
    process = subprocess.Popen(command, env=environment, cwd=REPOSITORY, stdout=sys.stderr, stderr=sys.stderr)
    try:
        _until(lambda: read_server(home) is not None, "the API answers")
        server = read_server(home)
        assert server is not None
        _until(lambda: httpx2.get(f"{server.url}/readyz").status_code == 200, "the server is ready")
        with Transport(server, timeout=60) as client:
            _until(lambda: _parses(client), "texts are parsed")
            yield server
    finally:
        process.terminate()
        process.wait(60)
        shutil.rmtree(home, ignore_errors=True)


def _parses(client: Transport) -> bool:
    try:
        client.post("/v1/texts/parse", {"prompts": ["a person walks"]})
    except MareyError:
        return False
    return True


if __name__ == "__main__":
    main()
