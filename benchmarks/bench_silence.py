"""Recovery time of the platform after its connections to a server have fallen silent.

The real processes reach Postgres, Valkey (queue) and an S3 server (store) through proxies that can stop forwarding
while every connection stays open. There are two faults of each: (a) all open connections fall silent for ever, and new
ones work: seconds from the start of the fault; (b) everything is silent for a minute, new connections too: seconds
from its end. Measured at the same time, in each fault:

- API: until `GET /v1/jobs` answers and keeps answering;
- scheduler: until a new job, for a queue whose worker is idle, has been claimed (a hint must reach the worker);
- worker: until the next commit of a worker in the middle of a long job;
- event stream: until an open stream delivers the next event of that job;
- watcher: until `watch_job` returns for a job whose one item is finished during the fault.

`MAREY_SILENCE_REPEATS` (3) and `MAREY_SILENCE_SECONDS` (60) change the length of a run, `MAREY_SILENCE_OF`
(`Postgres,queue,store`) which servers it has. Seven minutes a server.
"""

from __future__ import annotations

import os
import shutil
import statistics
import tempfile
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack, suppress
from pathlib import Path
from uuid import UUID

import httpx2
import sqlalchemy as sa

from benchmarks.platform import Platform
from marey.cli.watching import watch_job
from marey.client import Client
from marey.core.errors import Unreachable
from marey.db import transaction
from marey.embedded import postgres_url, socket_folder
from tests.chaos.places import S3
from tests.servers.stalling_proxy import StallingProxy
from tests.servers.swift import Swift
from tests.support.toy import REFERENCE
from tests.support.toy_jobs import job_row, submit_toys

REPEATS = int(os.environ.get("MAREY_SILENCE_REPEATS", "3"))
SERVERS = os.environ.get("MAREY_SILENCE_OF", "Postgres,queue,store").split(",")
SECONDS = float(os.environ.get("MAREY_SILENCE_SECONDS", "60"))
BARS = {"API": 15, "scheduler": 15, "worker": 15, "event stream": 20, "watcher": 20}
BATCH_SECONDS = 1.0
"""Of the long job, whose batches of 32 are committed one after the other."""
GIVE_UP = 120.0
SETTLED = 5.0
"""Seconds without a failure after which the API counts as back."""


def main() -> None:
    """Print, for both faults of each server and each part, the median and the worst of the repeats, and the bar."""
    home = Path(tempfile.mkdtemp(prefix="marey-"))
    with ExitStack() as stack:
        stack.callback(shutil.rmtree, home, ignore_errors=True)
        (home / "swift").mkdir()
        swift = Swift(home / "swift")
        swift.start()
        stack.callback(swift.stop)
        host, port = swift.endpoint.split(":")
        proxies = {
            "Postgres": StallingProxy(str(socket_folder(home) / ".s.PGSQL.5432")),
            "queue": StallingProxy(str(socket_folder(home) / "valkey.sock")),
            "store": StallingProxy((host, int(port))),
        }
        for proxy in proxies.values():
            stack.enter_context(proxy)
        url = sa.make_url(postgres_url(home)).set(host="127.0.0.1", port=proxies["Postgres"].port, query={})
        environment = {
            "MAREY_DATABASE_URL": url.render_as_string(hide_password=False),
            "MAREY_QUEUE_URL": f"redis://127.0.0.1:{proxies['queue'].port}/0",
            **S3(swift, proxies["store"]).environment,
        }
        with Platform(home, environment) as platform:
            _start(platform)
            long = submit_toys(
                platform.engine, ["walk"] * 32 * 3000, queue="long", steps=10, step_seconds=BATCH_SECONDS / 10
            )
            platform.wait(lambda: job_row(platform.engine, long).succeeded > 0, "the first commit")
            print(
                f"load {os.getloadavg()[0]:.1f}; {REPEATS} repeats of each fault; seconds, median (worst)", flush=True
            )
            for name in SERVERS:
                print(f"\n### {name}\n", flush=True)
                _run(platform, proxies[name], long)


def _start(platform: Platform) -> None:
    platform.serve()
    platform.start_scheduler()
    for queue in ("long", "short", "idle"):
        platform.start_worker(queue, queue=queue, reference=REFERENCE)
        platform.wait_ready(queue)


def _run(platform: Platform, proxy: StallingProxy, long: UUID) -> None:
    results: dict[str, dict[str, list[float]]] = {"a": {}, "b": {}}
    for repeat in range(REPEATS):
        for fault, found in results.items():
            for name, seconds in _Fault(platform, proxy, long, everything=fault == "b").measure().items():
                found.setdefault(name, []).append(seconds)
            last = ", ".join(f"{name} {times[-1]:.1f}" for name, times in found.items())
            print(f"({fault}) {repeat + 1}: {last}", flush=True)
            proxy.cut(silent=True)  # as a firewall forgets them in time
            time.sleep(15)  # leases and the pauses of retries are as before
    print(f"\n| what | bar | (a) from its start | (b) {SECONDS:g} s, from its end |\n|---|---|---|---|")
    for name, bar in BARS.items():
        cells = [f"{statistics.median(found[name]):.1f} ({max(found[name]):.1f})" for found in results.values()]
        print(f"| {name} | {bar} | {' | '.join(cells)} |")
    liveness = max(max(found["/livez, slowest"]) for found in results.values())
    print(f"\nSlowest `/livez` meanwhile: {liveness * 1000:.0f} ms. Load at the end: {os.getloadavg()[0]:.1f}.")


class _Fault:
    """One fault, and what is measured beside it."""

    def __init__(self, platform: Platform, proxy: StallingProxy, long: UUID, *, everything: bool) -> None:
        self._platform, self._proxy, self._long = platform, proxy, long
        self._everything = everything
        self._zero = self._seen_before = float("inf")
        self._ended = threading.Event()
        self._headers = {"Authorization": f"Bearer {platform.key}"}

    def measure(self) -> dict[str, float]:
        engine = self._platform.engine
        watched = submit_toys(engine, ["walk"], queue="short", steps=40, step_seconds=0.1)
        with ThreadPoolExecutor(8) as pool:
            events: Future[float] = pool.submit(self._next_event)
            watcher = pool.submit(self._watch, watched)
            self._platform.wait(lambda: job_row(engine, watched).started is not None, "the short job starts")
            time.sleep(1.0)
            liveness = pool.submit(self._slowest_livez)
            if self._everything:
                self._proxy.stall(new=True)
                time.sleep(SECONDS)
                self._proxy.resume()
            else:
                self._proxy.stall()
            self._zero = time.monotonic()
            self._seen_before = self._newest_event()
            committed = job_row(engine, self._long).succeeded
            fresh = submit_toys(engine, ["walk"], queue="idle")
            jobs = {
                "API": pool.submit(self._api),
                "scheduler": pool.submit(self._until, lambda: job_row(engine, fresh).started is not None),
                "worker": pool.submit(self._until, lambda: job_row(engine, self._long).succeeded > committed),
            }
            found = {name: job.result() for name, job in jobs.items()}
            found["event stream"] = events.result()
            found["watcher"] = watcher.result()
            self._ended.set()
            found["/livez, slowest"] = liveness.result()
        return found

    def _until(self, condition: Callable[[], bool]) -> float:
        while not condition():
            if time.monotonic() - self._zero > GIVE_UP:
                raise AssertionError(self._platform.logs())
            time.sleep(0.05)
        return time.monotonic() - self._zero

    def _api(self) -> float:
        """Until the first answer after which none failed any more for `SETTLED` seconds."""
        back: float | None = None
        while back is None or time.monotonic() - back < SETTLED:
            with suppress(httpx2.TransportError):
                answer = httpx2.get(f"{self._platform.url}/v1/jobs?limit=1", headers=self._headers, timeout=10)
                if answer.status_code == 200:
                    back = back or time.monotonic()
                    time.sleep(0.1)
                    continue
            back = None
            if time.monotonic() - self._zero > GIVE_UP:
                raise AssertionError(self._platform.logs())
            time.sleep(0.1)
        return back - self._zero

    def _slowest_livez(self) -> float:
        slowest = 0.0
        while not self._ended.wait(0.2):
            began = time.monotonic()
            httpx2.get(f"{self._platform.url}/livez", timeout=60)
            slowest = max(slowest, time.monotonic() - began)
        return slowest

    def _next_event(self) -> float:
        """Until a stream that was open before the fault delivers an event; opened again where the API ends it."""
        seen = self._newest_event()
        with self._platform.client() as client:
            while True:
                with suppress(Unreachable):
                    for event in client.events(str(self._long), after=seen):
                        seen = event["seq"]
                        if seen > self._seen_before:
                            return time.monotonic() - self._zero
                time.sleep(0.5)

    def _newest_event(self) -> int:
        with transaction(self._platform.engine) as conn:
            query = sa.text("SELECT event_seq FROM job WHERE id = :job")
            return conn.execute(query, {"job": self._long}).scalar_one()

    def _watch(self, job: UUID) -> float:
        with self._platform.client() as transport, Client(transport.server) as client:
            watch_job(client, str(job), quiet=True)
        return max(0.0, time.monotonic() - self._zero)  # 0: it returned during the fault, which did not concern it


if __name__ == "__main__":
    main()
