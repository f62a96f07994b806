"""Runs that end in a skid, or stop abruptly, where their words say so.

Networks slow down within a stride and set off again. Such a run is kept up to its last strides, and passes into a skid
that is drawn.
"""

from __future__ import annotations

import random

import numpy as np
from numpy.typing import NDArray

from marey.checks.kinematics import heading
from marey.drawing.skids import skid
from marey.motion.courses import course_of
from marey.motion.features import FeatureLayout, encode_all
from marey.motion.paced_features import pace_features
from marey.motion.rotations import about, rotate
from marey.posing.limbs import LEVEL
from marey.posing.standing import LEGS, StandingBody, eased

Float32 = NDArray[np.float32]
Array = NDArray[np.floating]

RUNS_S, LEAST_M = (1.6, 2.6), 1.8
"""Seconds of a run before it at most where its length is open, and metres a second of a run at least."""
STRIDE, PASSES = 14, 7
"""Frames near the end of a run that are searched for the moment in which it passes into a skid, and those of the way
from one to the other."""


def skidded(features: Float32, layout: FeatureLayout, how: str, seed: int, fixed: int | None = None) -> Float32 | None:
    """Return features (T', D) of a run that ends in a skid; None if it does not run.

    Args:
        features: (T, D), in the layout's own units, on the skeleton of HumanML3D.
        layout: of the features.
        how: `skid` or `stop`.
        seed: of the motion.
        fixed: frames of the whole; None = open.
    """
    rng = random.Random(f"{seed} skid")  # noqa: S311
    speeds = course_of(features, layout).speeds(layout.fps)
    fast = np.flatnonzero(speeds > 0.7 * np.quantile(speeds, 0.8))
    speed = float(np.median(speeds[fast])) if len(fast) else 0.0
    if speed < LEAST_M:
        return None
    done = skid(rng, speed, short=how == "stop")
    room = round(rng.uniform(*RUNS_S) * layout.fps) if fixed is None else fixed - len(done)
    last = min(int(fast[-1]), len(features) - 1 - PASSES, int(fast[0]) + max(room, round(layout.fps)))
    if last < STRIDE + 2:
        return None
    joints = layout.decode(features).astype(np.float64)
    ends = encode_all(layout, _passing(joints, done, last, layout.fps))
    return ends if fixed in (None, len(ends)) else pace_features(ends, layout.slices, fixed)


def _passing(run: Array, done: Array, last: int, fps: float) -> Array:
    """Return joints (T, 22, 3) of a run that passes into a skid, out of the moment of its last stride before the frame
    `last` in which both are most alike.

    Args:
        run: (T, 22, 3), metres.
        done: (T, 22, 3) of the skid, which begins at the speed of the run.
        last: frame of the run.
        fps: frames a second.
    """
    turns = np.radians(heading(run, fps) - heading(done, fps)[0])
    ends = range(last - STRIDE, last + 1)
    feet = [joint for leg in LEGS.values() for joint in leg[2:]]
    apart = [float(np.abs(_placed(done[:1], turns[end], run[end])[0, feet] - run[end, feet]).mean()) for end in ends]
    end = ends[int(np.argmin(apart))]
    comes = _placed(done, float(turns[end]), run[end])
    share = eased(np.arange(1, PASSES + 1) / (PASSES + 1))[:, None, None]
    way = (1 - share) * run[end : end + PASSES] + share * comes[:PASSES]
    return np.concatenate([run[:end], StandingBody(way).solved(), comes[PASSES:]])


def _placed(joints: Array, turn: float, pose: Array) -> Array:
    """Return joints (T, 22, 3), turned about the vertical by radians, whose pelvis begins over that of a pose
    (22, 3)."""
    turned = rotate(about("Y", np.array(turn))[None, None], joints - joints[0, 0] * LEVEL)
    return turned + pose[0] * LEVEL
