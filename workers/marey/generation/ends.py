"""Motions that end with their action: jumps on the floor, ways on a settled step, postures before the body rises.

A network fills the length that it is given: the last frames begin another hop, a foot is left in the air in the middle
of its step, or a body that knelt down begins to stand up. What comes after the last landing, the last moment at which
the feet of a walk are both down, or one of a run, or the last moment of rest, is left out.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from marey.generation.flights import JUMPS, UP_M, lowest_foot
from marey.motion.features import FeatureLayout
from marey.vocabulary.courses import RUNS

Float32 = NDArray[np.float32]

LANDING = JUMPS | {"jumping-jacks"}
"""Actions that end on the floor."""
STAYING = frozenset({"kneel", "crouch", "sit", "sit-down", "sit-floor", "lie", "lie-down", "die"})
"""Actions that end in a posture which is held."""
WALKS = frozenset({"walk", "walk-backward", "sneak", "carry", "limp", "march"})
"""Actions that end with both feet down."""
SETTLING = WALKS | RUNS
"""Actions that end on a settled step."""
STEP_S, DOWN_M = 0.7, 0.012
"""Seconds at the end of a way that are left out at most, in which a step is not made to its end, and metres over the
lowest place of a toe there up to which it is down."""
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
    if action in SETTLING:
        return _settled(features, layout, both=action in WALKS)
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


def _settled(features: Float32, layout: FeatureLayout, *, both: bool) -> Float32 | None:
    """Return the first T' of features (T, D) of a way, which ends with a foot on the floor, or both; None if it
    does."""
    toes = layout.decode(features)[..., 1][-max(round(STEP_S * layout.fps), 1) :, list(layout.skeleton.feet[1::2])]
    height = toes.max(axis=1) if both else toes.min(axis=1)
    left_out = int((height <= height.min() + DOWN_M)[::-1].argmax())
    return features[: len(features) - left_out] if left_out else None
