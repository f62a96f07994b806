"""Six JSON bodies of 56 MiB at once, sent to an API process by the command line's client, and a small request beside.

Bars: the API's resident peak under 400 MB, its spooled bytes under what docker-compose.yml's `/tmp` has, every body
accepted, and 95 of 100 small requests within 500 ms meanwhile.
"""

from __future__ import annotations

import json
import statistics
import subprocess
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any
from uuid import uuid4

import httpx2

from benchmarks.platform import BUNDLE, Platform, forget_peak, marey, peak_megabytes, platform
from marey.client.transport import SUBMIT_BUSY_SECONDS, SUBMIT_TIMEOUT

BODIES, MEGABYTES, ITEMS = 6, 56, 99_000
BARS = {"resident peak": (400, "MB"), "spooled peak": (256, "MB"), "small request, p95": (500, "ms")}
PAUSE = 0.05


def main() -> None:
    """Print the cost and each bar, for JSON and for `marey submit`, which sends NDJSON."""
    for kind in ("JSON, by the client", "NDJSON, by `marey submit`"):
        print(f"\n### {kind}\n")
        run(kind.startswith("NDJSON"))


def run(lines: bool, bodies: int = BODIES, items: int = ITEMS) -> None:
    """Print the table of one kind of body."""
    with platform() as cluster:
        api = cluster.serve()
        path = cluster.home / ("body.jsonl" if lines else "body.json")
        size = _write(path, items, lines)
        _post(cluster, _small())  # imports, pools and plans
        before = peak_megabytes(api.pid)
        forget_peak(api.pid)
        print(f"{bodies} bodies of {size / 2**20:.1f} MiB, {items:,} items each; the API before: {before:.0f} MB\n")
        alone = sorted(_ask(cluster) for _ in range(50))
        with _Beside(cluster, api.pid) as beside, ThreadPoolExecutor(bodies) as pool:
            began = time.perf_counter()
            send = partial(_command, cluster, path) if lines else partial(_post, cluster, path.read_bytes())
            took = sorted(pool.map(lambda _: send(), range(bodies)))
            seconds = time.perf_counter() - began
        time.sleep(5)
        found = {
            "resident peak": peak_megabytes(api.pid),
            "spooled peak": beside.spooled / 2**20,
            "small request, p95": 1e3 * statistics.quantiles(beside.times, n=20)[-1],
        }
        print("| what | measured | bar | |")
        print("|---|---|---|---|")
        for name, value in found.items():
            bar, unit = BARS[name]
            print(f"| {name} | {value:.0f} {unit} | < {bar} {unit} | {'met' if value < bar else 'MISSED'} |")
        print(f"| accepted | {len(took)} of {bodies} | all | {'met' if len(took) == bodies else 'MISSED'} |")
        print(f"\nSeconds of each, waits and retries included: {', '.join(f'{each:.0f}' for each in took)};")
        print(f"all: {seconds:.0f}. Small requests beside: {len(beside.times)}, median")
        print(f"{1e3 * statistics.median(beside.times):.0f} ms (before: {1e3 * alone[25]:.0f} ms).")
        print(f"Resident five seconds later: {api.memory_info().rss / 2**20:.0f} MB.")


def _write(path: Path, items: int, lines: bool) -> int:
    """A body of the size that was measured before: prompts of some sixty words."""
    filler = "and then turns to the left and waves with the right hand "
    item: dict[str, Any] = {"name": "", "seconds": 4.0, "seed": 0, "model": BUNDLE, "tags": ["crowd", "take 1"]}
    room = MEGABYTES * 2**20 // ITEMS - len(json.dumps(item)) - 12
    with path.open("w", encoding="utf-8") as stream:
        stream.write("" if lines else '{"name": "large", "items": [')
        for number in range(items):
            prompt = f"a person walks {number} steps {filler * (room // len(filler))}".strip()
            between = ("\n" if lines else ",") if number else ""
            stream.write(between + json.dumps({**item, "prompt": prompt, "name": f"sc{number:06d}"}))
        stream.write("" if lines else "]}")
    return path.stat().st_size


def _small() -> bytes:
    return json.dumps({"items": [{"prompt": "a person walks", "model": BUNDLE}]}).encode()


def _post(cluster: Platform, body: bytes) -> float:
    """Send a JSON body as the client sends what is long. Seconds until it is accepted, with all retries."""
    began = time.perf_counter()
    headers = {"Content-Type": "application/json", "Idempotency-Key": str(uuid4())}
    sent = {"content": body, "headers": headers, "timeout": SUBMIT_TIMEOUT}
    with cluster.client() as client:
        client._send("POST", "/v1/jobs", patience=SUBMIT_BUSY_SECONDS, **sent)  # pyright: ignore[reportPrivateUsage]
    return time.perf_counter() - began


def _command(cluster: Platform, path: Path) -> float:
    """The same by the command line."""
    began = time.perf_counter()
    command = marey("submit", "-f", str(path))
    subprocess.run(command, env=cluster.command_environment(), check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - began


def _ask(cluster: Platform) -> float:
    began = time.perf_counter()
    headers = {"Authorization": f"Bearer {cluster.key}"}
    httpx2.get(f"{cluster.url}/v1/jobs?limit=5", headers=headers, timeout=60).raise_for_status()
    return time.perf_counter() - began


class _Beside:
    """Asks for jobs repeatedly, and tracks the unlinked files that the API has open."""

    def __init__(self, cluster: Platform, pid: int) -> None:
        self.times: list[float] = []
        self.spooled = 0
        self._cluster, self._pid = cluster, pid
        self._stopping = threading.Event()
        self._threads = [threading.Thread(target=run) for run in (self._run, self._watch)]

    def __enter__(self) -> _Beside:
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stopping.set()
        for thread in self._threads:
            thread.join()

    def _run(self) -> None:
        while not self._stopping.wait(PAUSE):
            self.times.append(_ask(self._cluster))

    def _watch(self) -> None:
        while not self._stopping.wait(PAUSE):
            total = 0
            for entry in Path(f"/proc/{self._pid}/fd").iterdir():
                try:
                    stat = entry.stat()
                    if stat.st_nlink == 0:
                        total += stat.st_size
                except FileNotFoundError:
                    continue
            self.spooled = max(self.spooled, total)


if __name__ == "__main__":
    main()
