"""Motions that end with their action: jumps on the floor, and kneeling, sitting and lying bodies before they rise.

A network fills the length that it is given: the last frames begin another hop, or a body that knelt down begins to
stand up. What comes after the last landing, or the last moment of rest, is left out.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from marey.generation.flights import JUMPS, UP_M, lowest_foot
from marey.motion.features import FeatureLayout

Float32 = NDArray[np.float32]

LANDING = JUMPS | {"jumping-jacks"}
"""Actions that end on the floor."""
STAYING = frozenset({"kneel", "crouch", "sit", "sit-down", "sit-floor", "lie", "lie-down", "die"})
"""Actions that end in a posture which is held."""
LAST_S, RISE_M, STILL_M = 1.2, 0.05, 0.02
"""Seconds at the end in which a body may begin to rise, metres from which it does, and within which it does not yet."""
MOST_LEFT_OUT = 0.3
"""Share of a motion that is left out at most."""


def ended(features: Float32, layout: FeatureLayout, action: str) -> Float32 | None:
    """Return the first T' of features (T, D), without the beginning of what comes after the action; None if there is no
    such beginning.

    Args:
        features: in the layout's own units, on the skeleton of HumanML3D.
        layout: of the features.
        action: its id in the vocabulary.
    """
    joints = layout.decode(features).astype(np.float64)
    if action in LANDING:
        height, rests, leaves = lowest_foot(joints), UP_M, UP_M
    elif action in STAYING:
        height = joints[:, 0, 1] - joints[-round(LAST_S * layout.fps) :, 0, 1].min()
        rests, leaves = STILL_M, RISE_M
    else:
        return None
    if height[-1] <= leaves:
        return None
    frames = int(np.flatnonzero(height <= rests).max(initial=-1)) + 1
    return features[:frames] if frames >= (1 - MOST_LEFT_OUT) * len(features) else None
