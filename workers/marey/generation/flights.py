"""Bodies that come down: a floor that drifted away comes back, and flights last as long as their heights allow.

A network lets bodies hang in the air: runs of which no foot comes nearer than 8 cm to the floor, and jumps of 34 cm,
which last half a second, for 1.3 s. No flight of a person lasts a second, so within that a foot is brought to the
floor; what is still in the air is played so that it lasts as long as a rise to its height and a fall from it, or a
little longer. A motion that begins in the air begins as it lands.
"""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from marey.motion.features import FeatureLayout, encode_all
from marey.motion.feet import runs
from marey.motion.filters import smooth_seconds
from marey.posing.limbs import GRAVITY
from marey.vocabulary.courses import RUNS

Array = NDArray[np.floating]
Float32 = NDArray[np.float32]

JUMPS = frozenset({"jump", "jump-forward", "leap", "hop", "jump-turn"})
"""Actions whose flights are looked at."""
ON_FEET = JUMPS | {"walk", "walk-backward", "run", "sprint", "turn", "sidestep", "jumping-jacks"}
"""Actions on the floor."""
DANCES = frozenset({"dance"})
"""Actions whose flights keep their time, and come down where they hang in the air."""
ANKLES, TOES, ANKLE_M = [7, 8], [10, 11], 0.06
"""Joints, and metres of an ankle over the sole."""
UP_M = 0.04
"""Metres from the floor to the lowest foot from which on a body is in the air."""
LONGER, LEAST_S = 1.3, 0.3
"""How many times as long as a fall a flight may last, and seconds of one that is looked at."""
FASTEST = 3.0
"""How many times as fast a flight is played at most."""
PASSES_S = 0.05
"""Standard deviation of the filter in which the pace passes into that of a flight, seconds."""
REACH_S, DRIFT_M = 0.4, 0.015
"""Seconds before and after a moment within which a foot is on the floor, and metres of a drift that is looked at."""
STEP_REACH_S = 0.2
"""The same seconds in a run, whose steps follow each other faster."""
SHORTEST_S = 1.0
"""Seconds that a motion keeps whose beginning is left out."""


def fallen(features: Float32, layout: FeatureLayout) -> Float32 | None:
    """Return features (T', D) whose flights last no longer than their heights allow; None if they do not.

    Args:
        features: (T, D), in the layout's own units, on the skeleton of HumanML3D.
        layout: of the features.
    """
    joints, fps = layout.decode(features).astype(np.float64), layout.fps
    low = lowest_foot(joints)
    flights = [span for span in runs(low > UP_M) if span[1] - span[0] >= LEAST_S * fps]
    begins = next((end for begin, end in flights if begin == 0), 0)
    if len(joints) - begins < SHORTEST_S * fps:
        begins = 0
    rate = np.ones(len(joints))
    for begin, end in flights:
        rate[begin:end] = np.clip((end - begin) / _longest(low[begin:end], fps), 1.0, FASTEST)
    if not begins and rate.max() <= 1.0:
        return None
    joints, rate = joints[begins:], smooth_seconds(rate, PASSES_S, fps)[begins:]
    times = np.concatenate([[0.0], np.cumsum(1.0 / rate)[:-1]])  # of each frame, where it is played
    frames = int(times[-1]) + 1
    at = np.interp(np.arange(frames), times, np.arange(len(joints)))
    below = np.minimum(at.astype(int), len(joints) - 2)
    share = (at - below)[:, None, None]
    return encode_all(layout, (1 - share) * joints[below] + share * joints[below + 1])


def on_floor(features: Float32, layout: FeatureLayout, action: str = "") -> Float32 | None:
    """Return features (T, D) of a body that comes down to the floor at least once a second, and in each step of a run;
    None if it does.

    Args:
        features: (T, D), in the layout's own units, on the skeleton of HumanML3D.
        layout: of the features.
        action: its id in the vocabulary; empty = none that is known.
    """
    joints, fps = layout.decode(features).astype(np.float64), layout.fps
    reach = round((STEP_REACH_S if action in RUNS else REACH_S) * fps)
    near = sliding_window_view(np.pad(lowest_foot(joints), reach, mode="edge"), 2 * reach + 1)
    drift = smooth_seconds(near.min(1), 0.5 * reach / fps, fps)
    if drift.max() < DRIFT_M:
        return None
    joints[..., 1] -= np.maximum(drift, 0.0)[:, None]
    return encode_all(layout, joints)


def lowered(features: Float32, layout: FeatureLayout) -> Float32 | None:
    """Return features (T, D) of a body that stands where it hung in the air, longer than a jump of that height lasts;
    None if it does not hang.

    Args:
        features: (T, D), in the layout's own units, on the skeleton of HumanML3D.
        layout: of the features.
    """
    joints, fps = layout.decode(features).astype(np.float64), layout.fps
    low = lowest_foot(joints)
    hangs = np.zeros(len(joints))
    for begin, end in runs(low > UP_M):
        if end - begin > max(_longest(low[begin:end], fps), LEAST_S * fps):
            hangs[begin:end] = 1.0
    if not hangs.any():
        return None
    joints[..., 1] -= (smooth_seconds(hangs, PASSES_S, fps) * np.maximum(low, 0.0))[:, None]
    return encode_all(layout, joints)


def _longest(low: Array, fps: float) -> float:
    """Return frames that a flight lasts at most whose feet are at so many metres (T,)."""
    return float(max(2 * np.sqrt(2 * (low.max() - UP_M) / GRAVITY) * LONGER * fps, 1.0))


def lowest_foot(joints: Array) -> Array:
    """Return metres (T,) from the floor to the lowest point of the feet."""
    return np.minimum(joints[:, TOES, 1], joints[:, ANKLES, 1] - ANKLE_M).min(1)
