"""`marey fetch` of 1,000 motions as a process, against bare download loops of the same files in the same run."""

from __future__ import annotations

import hashlib
import os
import shutil
import statistics
import subprocess
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import httpx2
import psutil

from benchmarks.platform import BUNDLE, Platform, marey, platform, processor_seconds
from marey.client.downloads import PARALLEL
from marey.client.fetching import plan
from marey.client.file_to_fetch import FileToFetch
from marey.db import transaction
from marey.jobs import (
    AssetDigest,
    ClaimedItem,
    NewMotion,
    NewText,
    asset_key,
    begin_assets,
    claim,
    commit_motions,
    commit_texts,
)
from marey.storage import AssetStore, open_store
from marey.tenants import DEFAULT_TENANT
from tests.support.toy import QUEUE

MOTIONS = 1000
NPZ, BVH = 40 * 2**10, 120 * 2**10
"""Bytes of the files, as of some four seconds."""
REPEATS = 3


def main() -> None:
    """Print files a second, and processor time."""
    with platform() as cluster:
        api = cluster.serve()
        with cluster.client() as client:
            job = client.submit([{"prompt": f"walk {n} steps", "model": BUNDLE} for n in range(MOTIONS)])["id"]
            make_motions(cluster, _motion)
            planned = plan(client.pages(f"/v1/jobs/{job}/items", limit=1000), cluster.home / "bare", None)
        files = [file for _, of_item in planned for file in of_item]
        assert len(files) == 2 * MOTIONS
        ways: dict[str, Callable[[Path], float]] = {
            "`marey fetch`: checked by sha256, on the disk, with a manifest": lambda folder: _fetch(
                cluster, job, folder
            ),
            "a bare loop, one connection": lambda folder: _bare(cluster, files, folder, 1),
            f"the same in {PARALLEL} threads": lambda folder: _bare(cluster, files, folder, PARALLEL),
        }
        print(f"{len(files):,} files, {NPZ // 1024} and {BVH // 1024} KiB, {REPEATS} times in turns\n")
        print("| way | files/s, median | all | its CPU | the API's CPU |")
        print("|---|---|---|---|---|")
        _measure(cluster.home, api, ways, len(files))


def _measure(home: Path, api: psutil.Process, ways: dict[str, Callable[[Path], float]], files: int) -> None:
    taken: dict[str, list[tuple[float, float, float]]] = {name: [] for name in ways}
    for _ in range(REPEATS):
        for name, way in ways.items():
            folder = home / "fetched"
            folder.mkdir()
            before, started = processor_seconds(api), time.perf_counter()
            own = way(folder)
            taken[name].append((time.perf_counter() - started, own, processor_seconds(api) - before))
            assert len(list(folder.glob("*.npz"))) + len(list(folder.glob("*.bvh"))) == files
            shutil.rmtree(folder)
    for name, runs in taken.items():
        rates = [files / run[0] for run in runs]
        own, servers = (statistics.median(run[place] for run in runs) for place in (1, 2))
        spread = ", ".join(f"{rate:.0f}" for rate in rates)
        print(f"| {name} | {statistics.median(rates):.0f} | {spread} | {own:.1f} s | {servers:.1f} s |")


def _fetch(cluster: Platform, job: str, folder: Path) -> float:
    """Processor seconds of the command."""
    command = subprocess.Popen(
        marey("fetch", job, "-o", str(folder)), env=cluster.command_environment(), stdout=subprocess.DEVNULL
    )
    _, status, used = os.wait4(command.pid, 0)
    command.returncode = os.waitstatus_to_exitcode(status)
    assert command.returncode == 0
    return used.ru_utime + used.ru_stime


def _bare(cluster: Platform, files: Sequence[FileToFetch], folder: Path, threads: int) -> float:
    """Processor seconds of the loop, in this process: nothing is checked, resumed or flushed to the disk."""
    before = time.process_time()
    headers = {"Authorization": f"Bearer {cluster.key}"}
    with httpx2.Client(base_url=cluster.url, headers=headers) as client, ThreadPoolExecutor(threads) as pool:

        def one(file: FileToFetch) -> None:
            answer = client.get(file.url)
            assert answer.status_code == 200
            (folder / file.path.name).write_bytes(answer.content)

        list(pool.map(one, files))
    return time.process_time() - before


def make_motions(cluster: Platform, motion_of: Callable[[AssetStore, ClaimedItem], NewMotion]) -> None:
    """Complete a job's items with the motions that `motion_of` writes to the store."""
    store = open_store(cluster.settings())
    while True:
        with transaction(cluster.engine) as conn:
            texts = claim(conn, "text", "hands", 256)
            if texts is None:
                break
            commit_texts(conn, texts.lease_token, [NewText(item.id, item.text_key, b"text") for item in texts.items])
    while True:
        with transaction(cluster.engine) as conn:
            found = claim(conn, QUEUE, "hands", 256)
        if found is None:
            return
        motions = [motion_of(store, item) for item in found.items]
        with transaction(cluster.engine) as conn:
            begin_assets(conn, found.lease_token, [file for motion in motions for file in motion.files.values()])
        with transaction(cluster.engine) as conn:
            commit_motions(conn, found.lease_token, motions)


def _motion(store: AssetStore, item: ClaimedItem) -> NewMotion:
    """Files of the usual size, no two the same."""
    digests: dict[str, AssetDigest] = {}
    for ending, size in (("npz", NPZ), ("bvh", BVH)):
        content = hashlib.shake_128(f"{item.id} {ending}".encode()).digest(size)
        digests[ending] = AssetDigest(hashlib.sha256(content).hexdigest(), len(content))
        store.put(asset_key(DEFAULT_TENANT, digests[ending].sha256), content)
    return NewMotion(item.id, digests, 80, 20.0, "MIT", 0.5, {})


if __name__ == "__main__":
    main()
