"""Runs that run from their first frame.

Half of the runs that a network makes stand for a second and more before they set off, and are no longer than that
behind it. They are asked for with more frames, and what comes before they are on their way is left out.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from marey.generation.footing import RUNS
from marey.generation.port import Limits
from marey.motion.features import FeatureLayout
from marey.motion.filters import smooth

Float32 = NDArray[np.float32]

LEAD_S = 1.6
"""Seconds for which a run may stand before it sets off."""
UNDER_WAY, SETS_OFF_S = 0.5, 0.2
"""Share of its speed at which a body is under way, and seconds that are kept before."""
SMOOTH_S = 0.1
"""Standard deviation of the filter of its speed."""


def frames_to_begin(action: str, frames: int, limits: Limits) -> int:
    """Return the frames in which a network makes a run of `frames` and stands before it; `frames` for other actions."""
    return limits.within(frames + round(LEAD_S * limits.fps)) if action in RUNS else frames


def begun(features: Float32, layout: FeatureLayout, action: str) -> int:
    """Return the frames at the beginning of features (T, D) in which a run does not run yet; 0 for other actions, and
    for a body that never runs."""
    if action not in RUNS:
        return 0
    way = layout.decode(features)[:, 0, [0, 2]].astype(np.float64)
    speed = np.linalg.norm(smooth(np.gradient(way, axis=0), SMOOTH_S * layout.fps), axis=1) * layout.fps
    top = np.quantile(speed, 0.8)
    if top < UNDER_WAY * RUNS[action]:
        return 0
    return max(int((speed > UNDER_WAY * top).argmax()) - round(SETS_OFF_S * layout.fps), 0)
