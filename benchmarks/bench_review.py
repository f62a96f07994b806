"""`marey review` of 310 motions as a process, with their download from an API on the same machine.

The motions are made once by the last of the installed models: 31 prompts, each copied nine times with another seed in
its file, so that no two files are the same. The baseline of the same run is the drawing alone, in one process.
"""

from __future__ import annotations

import hashlib
import os
import statistics
import subprocess
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from benchmarks.bench_fetch import make_motions
from benchmarks.platform import BUNDLE, Platform, marey, platform
from marey.checks.prompts import evaluation_prompts
from marey.cli.drawing import Drawing, draw
from marey.jobs import AssetDigest, ClaimedItem, NewMotion, asset_key
from marey.motion.clip import MotionClip, load_npz
from marey.registry import model_names
from marey.storage import AssetStore
from marey.tenants import DEFAULT_TENANT

PROMPTS, COPIES = 31, 10
REPEATS, WARM_UP = 3, 1
BAR_SECONDS = 15


def main() -> None:
    """Print seconds of each kind of page."""
    with tempfile.TemporaryDirectory(prefix="marey-") as folder, platform() as cluster:
        prompts = [prompt.text for prompt in evaluation_prompts()][:: len(evaluation_prompts()) // PROMPTS][:PROMPTS]
        files = _generate(cluster, prompts, Path(folder))
        cluster.serve()
        with cluster.client() as client:
            rows = [{"prompt": prompt, "seed": 0, "variants": COPIES, "model": BUNDLE} for prompt in prompts]
            job = client.submit(rows)["id"]
        clips = {prompt: load_npz(file) for prompt, file in zip(prompts, files, strict=True)}
        make_motions(cluster, lambda store, item: _motion(store, item, clips[item.prompt]))
        ways: dict[str, Callable[[], object]] = {
            "`marey review -o x.png`: one sheet of tiles": lambda: _review(cluster, job, "x.png"),
            "`marey review -o x.png --per-page 24`: 13 sheets of rows": lambda: _review(
                cluster, job, "x.png", "--per-page", "24"
            ),
            "`marey review -o x.html`: one page of players": lambda: _review(cluster, job, "x.html"),
            "drawing the tiles alone, one process": lambda: [draw(Drawing(file, "")) for file in files * COPIES],
        }
        _measure(ways)


def _measure(ways: dict[str, Callable[[], object]]) -> None:
    times: dict[str, list[float]] = {name: [] for name in ways}
    for turn in range(WARM_UP + REPEATS):
        for name, way in ways.items():
            started = time.perf_counter()
            way()
            if turn >= WARM_UP:
                times[name].append(time.perf_counter() - started)
    base = statistics.median(list(times.values())[-1])
    print(f"{PROMPTS * COPIES} motions, {REPEATS} times in turns; the bar is {BAR_SECONDS} s for x.png\n")
    print("| way | seconds, median | all | speed |\n|---|---|---|---|")
    for name, taken in times.items():
        median = statistics.median(taken)
        print(f"| {name} | {median:.1f} | {', '.join(f'{each:.1f}' for each in taken)} | {base / median:.2f} x |")


def _generate(cluster: Platform, prompts: list[str], folder: Path) -> list[Path]:
    """The files of these prompts, in their order, as the shipped bundle makes them."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith("MAREY_")}
    options = ("--model", model_names()[-1], "--format", "npz", "--seed", "1", "-o", str(folder))
    done = subprocess.run(
        marey("generate", *prompts, *options), env=environment, stdout=subprocess.PIPE, text=True, check=True
    )
    return [Path(line) for line in done.stdout.splitlines()]


def _review(cluster: Platform, job: str, name: str, *options: str) -> None:
    with tempfile.TemporaryDirectory(prefix="marey-") as folder:
        command = marey("review", job, "-o", str(Path(folder) / name), *options)
        subprocess.run(
            command,
            env=cluster.command_environment(),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            check=True,
        )


def _motion(store: AssetStore, item: ClaimedItem, clip: MotionClip) -> NewMotion:
    content = replace(clip, manifest={**clip.manifest, "seed": item.seed}).to_npz()
    digest = AssetDigest(hashlib.sha256(content).hexdigest(), len(content))
    store.put(asset_key(DEFAULT_TENANT, digest.sha256), content)
    return NewMotion(item.id, {"npz": digest}, clip.frames, clip.fps, "CC-BY-NC-4.0", 0.5, {})


if __name__ == "__main__":
    main()
