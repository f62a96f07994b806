"""Arms that stay raised in the next movement: who raises her arms and turns around does not let them down before.

A movement that raises the arms is drawn with their way down. Before a turn it ends while they are up, and they are held
in the turn until shortly before its end.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from marey.generation.shots.flowing import JoinedRows
from marey.motion.features import FeatureLayout, encode_all
from marey.motion.rotations import normalize
from marey.posing.limbs import FPS
from marey.posing.standing import ARMS, StandingBody, eased

Float32 = NDArray[np.float32]
Array = NDArray[np.floating]

RAISING = frozenset({"raise-arm"})
"""Actions that raise the arms."""
TURNING = frozenset({"turn-around", "turn", "spin"})
"""Actions in which they stay where they are."""
HELD = 0.95
"""Share of the height of the wrists over the hips at which an arm is still up."""
LOWERS_S = 0.7
"""Seconds before the end of the turn in which the arms come down."""
ABOVE_M = 0.25
"""Metres of a wrist over the hips of an arm that is raised, at least."""


def kept_arms(before: Float32, after: Float32, layout: FeatureLayout) -> JoinedRows | None:
    """Return a movement that ends with raised arms, and a turn with these; None if no arm is raised.

    Args:
        before: features (T, D) of the movement that raises them, at 20 fps, on the skeleton of HumanML3D.
        after: the same of the turn.
        layout: of the features.
    """
    raises, turns = (layout.decode(each).astype(np.float64) for each in (before, after))
    high = {side: raises[:, arm[-1], 1] - raises[:, 0, 1] for side, arm in ARMS.items()}
    sides = [side for side in ARMS if high[side].max() > ABOVE_M]
    if not sides:
        return None
    last = max(int(np.flatnonzero(high[side] >= HELD * high[side].max())[-1]) for side in sides)
    pose, body = StandingBody(raises[last : last + 1].repeat(2, axis=0)), StandingBody(turns)
    share = eased((len(turns) - 1 - np.arange(len(turns))) / (LOWERS_S * FPS))
    for side in sides:
        _, shoulder, elbow, wrist = ARMS[side]
        bones = [
            pose.local(normalize(pose.joints[:, b] - pose.joints[:, a]), side)[0]
            for a, b in ((shoulder, elbow), (elbow, wrist))
        ]
        body.move_arm(side, share, *bones, lag=0.0)
    return JoinedRows(before[: last + 1], encode_all(layout, body.solved()), 0)
