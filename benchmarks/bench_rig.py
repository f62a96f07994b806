"""Motions of 200 frames on a rig of 65 joints: processor time of one core a motion, alone and from a stored motion.

Retargeting and FBX together take 30 ms at most. Beside the functions, 1,000 different motions of a job that is done are
asked for as FBX on `mixamo`, one after the other: that is how files on rigs are made (workers write none). There the
processor time of the API's child counts, which reads the npz, puts it on the rig and writes the file.

OMP_NUM_THREADS=1 python -m benchmarks rig
"""

from __future__ import annotations

import hashlib
import statistics
from collections.abc import Iterable
from pathlib import Path

import httpx2
import numpy as np
import psutil

from benchmarks.bench_fetch import make_motions
from benchmarks.harness import measure, processor_seconds, table
from benchmarks.platform import BUNDLE, Platform, platform
from marey.jobs import AssetDigest, ClaimedItem, NewMotion, asset_key
from marey.motion.io.rigged_fbx import format_rigged_fbx
from marey.motion.io.rigged_glb import format_rigged_glb
from marey.motion.retarget import load_body, retarget, source_of
from marey.storage import AssetStore
from marey.tenants import DEFAULT_TENANT
from tests.support.walker import walker

FRAMES = 200
CALLS = 1000
MOTIONS = 1000
RIG = "mixamo"
STORED, MADE = "npz, stored", f"fbx on {RIG}"
WAIT = 120.0
"""Seconds that a client waits for an answer."""
WARM_UP = 3
"""Files that are not counted: the first one starts a child, which imports what it needs."""


def main() -> None:
    """Measure and print."""
    functions()
    queued()


def functions() -> None:
    """Print the times of the functions, called again and again with one motion."""
    clip = walker(seconds=(FRAMES - 1) / 20.0)
    body = load_body(RIG)
    motion = retarget(source_of(clip), body)
    steps = {
        "retarget to 65 joints": lambda: retarget(source_of(clip), body),
        "write glb": lambda: format_rigged_glb(motion),
        "write FBX": lambda: format_rigged_fbx(motion),
    }
    print(table(f"{FRAMES} frames onto 65 joints", measure(steps)))
    medians = {name: statistics.median(processor_seconds(run) for _ in range(CALLS)) for name, run in steps.items()}
    for name, seconds in medians.items():
        print(f"{name}: {1e3 * seconds:.1f} ms of processor time, median of {CALLS}")
    both = medians["retarget to 65 joints"] + medians["write FBX"]
    print(f"retarget and write FBX: {1e3 * both:.1f} ms")


def queued() -> None:
    """Print what files on a rig cost the server, one for each motion of a job."""
    with platform() as cluster:
        api = cluster.serve()
        with cluster.client() as client:
            client.submit([{"prompt": f"walk {n} steps", "model": BUNDLE} for n in range(MOTIONS)])
            make_motions(cluster, _motion)
            motions = [motion["id"] for motion in client.pages("/v1/motions", limit=100)]
        assert len(motions) == MOTIONS
        costs = {
            name: _cost(cluster, api, [f"/v1/motions/{motion}/files/{file}" for motion in motions])
            for name, file in ((STORED, "npz"), (MADE, f"fbx?rig={RIG}"))
        }
    print(f"\n| of {MOTIONS} different motions, median | API | its child |\n|---|---|---|")
    for name, seconds in costs.items():
        print(f"| {name} |" + "".join(f" {1e3 * each:.1f} ms |" for each in np.median(seconds, axis=0)))
    own, child = np.median(costs[MADE], axis=0) - np.median(costs[STORED], axis=0)
    print(f"\na file on the rig adds {1e3 * child:.1f} ms where it is made, {1e3 * own:.1f} ms to find and keep it")


def _motion(store: AssetStore, item: ClaimedItem) -> NewMotion:
    """A walk of 200 frames that no other item has."""
    turn = int(hashlib.sha256(str(item.id).encode()).hexdigest()[:8], 16) / 2**32 - 0.5
    content = walker(seconds=(FRAMES - 1) / 20.0, turn=turn).to_npz()
    digest = AssetDigest(hashlib.sha256(content).hexdigest(), len(content))
    store.put(asset_key(DEFAULT_TENANT, digest.sha256), content)
    return NewMotion(item.id, {"npz": digest}, FRAMES, 20.0, "MIT", 0.5, {})


def _cost(cluster: Platform, api: psutil.Process, paths: list[str]) -> list[tuple[float, float]]:
    """Return the processor seconds of the API, and of its children, for each path, asked for one after the other."""
    headers = {"Authorization": f"Bearer {cluster.key}"}
    found: list[tuple[float, float]] = []
    with httpx2.Client(base_url=cluster.url, headers=headers, timeout=WAIT, follow_redirects=True) as client:
        for number, path in enumerate(paths):
            before = _seconds([api]), _seconds(api.children(recursive=True))
            answer = client.get(path)
            after = _seconds([api]), _seconds(api.children(recursive=True))
            assert answer.status_code == 200, answer.text
            if number >= WARM_UP:
                found.append((after[0] - before[0], after[1] - before[1]))
    return found


def _seconds(processes: Iterable[psutil.Process]) -> float:
    """Return the processor seconds of all threads of processes, to the microsecond."""
    threads = [task for each in processes for task in Path(f"/proc/{each.pid}/task").iterdir()]
    return sum(int((task / "schedstat").read_text(encoding="ascii").split()[0]) for task in threads) / 1e9


if __name__ == "__main__":
    main()
