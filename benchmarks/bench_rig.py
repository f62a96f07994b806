"""Retargeting to a rig of 65 joints: milliseconds of one core a motion of 200 frames, and of writing it as glb and FBX.

Processor time is measured as well, which hardly depends on what else runs: retargeting and FBX together take 30 ms.

OMP_NUM_THREADS=1 python -m benchmarks rig
"""

from __future__ import annotations

import statistics

from benchmarks.harness import measure, processor_seconds, table
from marey.motion.io.rigged_fbx import format_rigged_fbx
from marey.motion.io.rigged_glb import format_rigged_glb
from marey.motion.retarget import load_body, retarget, source_of
from tests.support.walker import walker

FRAMES = 200
CALLS = 1000


def main() -> None:
    """Measure and print."""
    clip = walker(seconds=(FRAMES - 1) / 20.0)
    body = load_body("mixamo")
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


if __name__ == "__main__":
    main()
