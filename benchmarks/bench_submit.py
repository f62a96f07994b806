"""A CSV through `marey submit` as a process, to an API process, until the job's id is printed; and the memory it takes.

The database's part of it alone is measured by `jobs`.
"""

from __future__ import annotations

import csv
import os
import subprocess
import threading
import time
from dataclasses import dataclass
from pathlib import Path

import psutil

from benchmarks.platform import BUNDLE, Platform, forget_peak, marey, peak_megabytes, platform, processor_seconds
from marey.items.item import MAX_BODY_BYTES, MAX_ITEMS

SIZES = {1_000: 3, 10_000: 5, 100_000: 1}
"""Prompts, and how often."""


@dataclass(frozen=True)
class Run:
    """One `marey submit`; seconds, and megabytes at the most."""

    seconds: float
    command_cpu: float
    api_cpu: float
    command_peak: float
    api_peak: float


def main() -> None:
    """Print the table."""
    with platform() as cluster:
        api = cluster.serve()
        _submit(cluster, api, 100)  # imports, pools and plans
        before, limit = peak_megabytes(api.pid), MAX_BODY_BYTES // 2**20
        print(f"At most {MAX_ITEMS:,} items and {limit} MiB a request; the API before: {before:.0f} MB\n")
        print("| prompts | seconds, each | command, CPU | API, CPU | command, peak | API, peak |")
        print("|---|---|---|---|---|---|")
        for size, repeats in SIZES.items():
            runs = [_submit(cluster, api, size) for _ in range(repeats)]
            seconds = ", ".join(f"{run.seconds:.2f}" for run in sorted(runs, key=lambda run: run.seconds))
            middle = sorted(runs, key=lambda run: run.command_cpu + run.api_cpu)[repeats // 2]
            peaks = max(run.command_peak for run in runs), max(run.api_peak for run in runs)
            print(
                f"| {size:,} | {seconds} | {middle.command_cpu:.2f} s | {middle.api_cpu:.2f} s "
                f"| {peaks[0]:.0f} MB | {peaks[1]:.0f} MB |"
            )


def _submit(cluster: Platform, api: psutil.Process, size: int) -> Run:
    path = cluster.home / f"{size}.csv"
    if not path.exists():
        _write(path, size)
    forget_peak(api.pid)
    before = processor_seconds(api)
    started = time.perf_counter()
    command = subprocess.Popen(
        marey("submit", "-f", str(path)), env=cluster.command_environment(), stdout=subprocess.PIPE
    )
    peak = _Peak(command.pid)
    assert command.stdout is not None
    job = command.stdout.read().decode().strip()
    _, status, used = os.wait4(command.pid, 0)
    seconds = time.perf_counter() - started
    command.returncode = os.waitstatus_to_exitcode(status)
    assert command.returncode == 0
    with cluster.client() as client:
        row = client.get(f"/v1/jobs/{job}")
    assert row["total"] == size
    return Run(
        seconds, used.ru_utime + used.ru_stime, processor_seconds(api) - before, peak.stop(), peak_megabytes(api.pid)
    )


def _write(path: Path, size: int) -> None:
    """A studio's table: names, lengths, tags, prompts of some fifteen words."""
    with path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow(["prompt", "name", "seconds", "seed", "model", "tags"])
        for number in range(size):
            prompt = f"a person walks {number} steps forward, turns left and waves with the right hand"
            writer.writerow([prompt, f"sc{number:06d}", 4 + number % 5, number, BUNDLE, "crowd;take 1"])


class _Peak:
    """The most memory of a process until it ends."""

    def __init__(self, pid: int) -> None:
        self._pid, self._most, self._stopping = pid, 0.0, threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        while not self._stopping.wait(0.01):
            try:
                self._most = max(self._most, peak_megabytes(self._pid))
            except (FileNotFoundError, ProcessLookupError):
                return

    def stop(self) -> float:
        """Megabytes."""
        self._stopping.set()
        self._thread.join()
        return self._most


if __name__ == "__main__":
    main()
