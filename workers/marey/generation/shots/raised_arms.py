"""Arms that stay raised in the next movement: who raises her arms and turns around does not let them down before, and
who fights and steps back keeps the guard up.

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
FIGHTING = frozenset({"punch", "kick", "block", "dodge"})
"""Actions of who has the guard up, and keeps it in the steps between two of them."""
STEPPING_ASIDE = frozenset({"walk-backward", "sidestep"})
"""Actions that are such steps."""
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
    share = eased((len(turns) - 1 - np.arange(len(turns))) / (LOWERS_S * FPS))
    held = _holding(turns, raises[last : last + 1], sides, share)
    return JoinedRows(before[: last + 1], encode_all(layout, held), 0)


def guarded(before: Float32, between: Float32, after: Float32 | None, layout: FeatureLayout) -> JoinedRows | None:
    """Return a movement of a fight that ends with its guard up, and the steps behind it with that guard; None if there
    is no guard.

    Args:
        before: features (T, D) of the blow or block before the steps, at 20 fps, on the skeleton of HumanML3D.
        between: the same of the steps.
        after: the same of the blow or block behind them, whose guard counts first; None = there is none.
        layout: of the features.
    """
    fights = layout.decode(before).astype(np.float64)
    up = np.flatnonzero(_is_guard(fights))
    poses = [] if after is None else [layout.decode(after[:1]).astype(np.float64)]
    poses = [pose for pose in poses if _is_guard(pose).all()] + [fights[frame : frame + 1] for frame in up[-1:]]
    if not (poses and len(up)):
        return None
    steps = layout.decode(between).astype(np.float64)
    held = _holding(steps, poses[0], list(ARMS), np.ones(len(steps)))
    return JoinedRows(before[: int(up[-1]) + 1], encode_all(layout, held), 0)


def _is_guard(joints: Array) -> NDArray[np.bool_]:
    """Return the frames (T,) in which both wrists are well above the hips."""
    return np.all([joints[:, arm[-1], 1] - joints[:, 0, 1] > ABOVE_M for arm in ARMS.values()], axis=0)


def _holding(joints: Array, pose: Array, sides: list[str], share: Array) -> Array:
    """Return joints (T, 22, 3) of a body that holds arms as in a pose (1, 22, 3), so far as `share` (T,) says."""
    held, body = StandingBody(pose.repeat(2, axis=0)), StandingBody(joints)
    for side in sides:
        _, shoulder, elbow, wrist = ARMS[side]
        bones = [
            held.local(normalize(held.joints[:, b] - held.joints[:, a]), side)[0]
            for a, b in ((shoulder, elbow), (elbow, wrist))
        ]
        body.move_arm(side, share, *bones, lag=0.0)
    return body.solved()
