"""Runs that run from their first frame, and short walks.

Half of the runs that a network makes stand for a second and more before they set off, and are no longer than that
behind it. They are asked for with more frames, and what comes before they are on their way is left out. Walks of less
than two seconds are made in a crouch; they are the beginning of longer ones.
"""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from marey.generation.footing import RUN_SPEEDS
from marey.generation.port import Limits
from marey.motion.features import FeatureLayout
from marey.motion.filters import smooth

Float32 = NDArray[np.float32]

LEAD_S = 1.6
"""Seconds for which a run may stand before it sets off."""
UNDER_WAY, SETS_OFF_S, STANDS_S = 0.5, 0.2, 0.7
"""Share of its speed at which a body is under way, seconds that are kept before, and of a start from rest."""
_STARTS = re.compile(
    r"\b(?:sprint|standing|running|fast|quick|flying|race|explosive) start\b"
    r"|\bstarts? (?:from|running|to (?:run|sprint))\b|\b(?:sets?|takes?|bolts?|tears?) off\b"
    r"|\bbreaks? into\b|\baccelerat\w+|\boff the (?:line|blocks?|mark)\b"
)
"""Words of a run from rest."""
SMOOTH_S = 0.1
"""Standard deviation of the filter of its speed."""


SHORT_WALK_S = 2.4
"""Seconds for which a network is asked of a walk at least."""


def frames_to_begin(action: str, frames: int, limits: Limits) -> int:
    """Return the frames in which a network makes a run of `frames` and stands before it, or a walk that is upright;
    `frames` for other actions."""
    if action == "walk":
        return max(frames, limits.within(round(SHORT_WALK_S * limits.fps)))
    return limits.within(frames + round(LEAD_S * limits.fps)) if action in RUN_SPEEDS else frames


def begun(features: Float32, layout: FeatureLayout, action: str, said: str = "") -> int:
    """Return the frames at the beginning of features (T, D) in which a run does not run yet; 0 for other actions, and
    for a body that never runs.

    Args:
        features: (T, D), in the layout's own units.
        layout: of the features.
        action: id in the vocabulary.
        said: the prompt; where it asks for a start from rest, the body stands for a moment before it.
    """
    if action not in RUN_SPEEDS:
        return 0
    way = layout.decode(features)[:, 0, [0, 2]].astype(np.float64)
    speed = np.linalg.norm(smooth(np.gradient(way, axis=0), SMOOTH_S * layout.fps), axis=1) * layout.fps
    top = np.quantile(speed, 0.8)
    if top < UNDER_WAY * RUN_SPEEDS[action]:
        return 0
    before_s = STANDS_S if _STARTS.search(said.lower()) else SETS_OFF_S
    return max(int((speed > UNDER_WAY * top).argmax()) - round(before_s * layout.fps), 0)
