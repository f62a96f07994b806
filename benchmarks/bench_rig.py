"""Retargeting to a rig of 65 joints: milliseconds of one core a motion of 200 frames, and of writing it as glb.

OMP_NUM_THREADS=1 python -m benchmarks rig
"""

from __future__ import annotations

from benchmarks.harness import measure, table
from marey.motion.io.rigged_glb import format_rigged_glb
from marey.motion.retarget import load_body, retarget, source_of
from tests.support.walker import walker

FRAMES = 200


def main() -> None:
    """Measure and print."""
    clip = walker(seconds=(FRAMES - 1) / 20.0)
    body = load_body("mixamo")
    motion = retarget(source_of(clip), body)
    steps = {
        "retarget to 65 joints": lambda: retarget(source_of(clip), body),
        "write glb": lambda: format_rigged_glb(motion),
    }
    print(table(f"{FRAMES} frames onto 65 joints", measure(steps)))


if __name__ == "__main__":
    main()
