"""Finish of generated motions beside that of real ones: sliding feet, acceleration, and arms inside the body.

The captions of the test clips of a prepared folder are generated, as long as their clips, with two seeds. Needs the
folder in `MAREY_PREPARED` (`marey data prepare`); the bundle is `MAREY_BUNDLE`, else the default one.

    MAREY_PREPARED=DIR OMP_NUM_THREADS=1 python -m benchmarks finish
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from marey.core.settings import settings
from marey.data.prepared import PreparedData
from marey.generate import load
from marey.motion.capsules import SIDES, Array, depth
from marey.quality.measure import skate

SEEDS = (0, 1)
SHORTEST, LONGEST_S = 40, 9.8
"""Frames of the shortest clip that is taken, and seconds of the longest motion."""
DEEP = 0.01
"""Metres from which on a forearm is inside another part of the body."""


def main() -> None:
    folder = os.environ.get("MAREY_PREPARED")
    if not folder:
        print("skipped: MAREY_PREPARED names no prepared folder")
        return
    prepared = PreparedData.open(Path(folder))
    clips = [clip for clip in prepared.split("test") if not clip.mirrored and not clip.spliced and clip.speed == 1.0]
    clips = [clip for clip in clips if clip.length >= SHORTEST]
    real = [_numbers(np.asarray(prepared.joints(clip), np.float64), prepared.layout.fps) for clip in clips]
    model, made = load(os.environ.get("MAREY_BUNDLE", settings().default_model)), list[Mapping[str, float]]()
    for clip in clips:
        for seed in SEEDS:
            (motion,) = model.generate([clip.captions[0]], seed=seed, seconds=min(clip.measured.seconds, LONGEST_S))
            made.append(_numbers(motion.joints.astype(np.float64), motion.fps))
    usual = float(np.percentile([each["acceleration"] for each in real], 99))
    beyond = float(np.mean([each["acceleration"] > usual for each in made]))
    worst = float(np.percentile([each["acceleration"] for each in made], 99))
    rows = [
        ("frames in which feet slide", *(f"{_share(each, 'skate'):.1%}" for each in (real, made))),
        ("frames with a forearm 1 cm inside the body", *(f"{_share(each, 'inside'):.2%}" for each in (real, made))),
        ("acceleration that 99 % of the clips stay below, m/s²", f"{usual:.0f}", f"{worst:.0f}"),
        ("clips beyond that of real ones", "1.0%", f"{beyond:.1%}"),
    ]
    print(f"{len(real)} real clips, {len(made)} motions of their captions\n")
    print("| | real | generated |\n|---|---|---|")
    print("\n".join(f"| {' | '.join(row)} |" for row in rows))


def _share(motions: Sequence[Mapping[str, float]], name: str) -> float:
    return float(np.average([each[name] for each in motions], weights=[each["frames"] for each in motions]))


def _numbers(joints: Array, fps: float) -> dict[str, float]:
    """Return the shares of frames and the acceleration of one motion (T, 22, 3), metres."""
    acceleration = np.linalg.norm(np.diff(joints, 2, axis=0), axis=-1) * fps**2
    return {
        "frames": float(len(joints)),
        "skate": skate(joints, fps),
        "inside": float(_inside(joints).mean()),
        "acceleration": float(np.percentile(acceleration, 99.9)),
    }


def _inside(joints: Array) -> Array:
    """Return the frames (T,) in which a forearm is inside trunk, head or a thigh."""
    found = np.zeros(len(joints), bool)
    for arm in (f"{side}forearm" for side in SIDES):
        for other in ("trunk", "head", *(f"{side}thigh" for side in SIDES)):
            found |= depth(joints, arm, other) > DEEP
    return found


if __name__ == "__main__":
    main()
