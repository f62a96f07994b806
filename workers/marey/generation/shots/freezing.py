"""Bodies that stop in the middle of a way and stay in its posture: who creeps and freezes does not stand up.

A body that stands and waits is drawn upright. Behind a sneaking body, and where the words say that it freezes, the last
moment in which both feet stand is held instead.
"""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from marey.generation.shots.flowing import JoinedRows
from marey.motion.features import FeatureLayout, encode_all
from marey.motion.filters import smooth
from marey.posing.limbs import FPS
from marey.posing.standing import LEGS, StandingBody, poses_at

Float32 = NDArray[np.float32]
Array = NDArray[np.floating]

AS_BEFORE = "as before"
"""Name of the posture of such a body, in the record of its row."""
LOW = frozenset({"sneak"})
"""Actions whose posture is kept wherever the body stops behind them."""
FREEZES_FROM = frozenset({"walk", "walk-backward", "march", "sidestep", *LOW})
"""Actions that are slow enough to be held in the middle."""
_FREEZES = re.compile(
    r"\b(?:freez\w*|froze\w*|stops? dead|motionless|stock[ -]still"
    r"|hold(?:s|ing)? (?:\w+ly |very )?still"
    r"|hold(?:s|ing)? (?:(?:his|her|their|the|that|this) )?(?:pose|position)|in (?:his|her|their) tracks"
    r"|(?:stays?|stands?|goes) (?:perfectly|completely|absolutely|dead) still|like a statue)\b"
)
"""Words of a body that stops as it is."""
LATEST_S = 1.2
"""Seconds before the end of a way within which it is held."""
SLOWS_S = 0.35
"""Seconds in which the body comes to rest."""
BREATHS_M, BREATHS_HZ = 0.003, 0.27
"""Metres by which a body that is held rises and sinks, and how often a second."""
LEAST = 24
"""Frames of a way that is held, at least."""


def says_frozen(said: str) -> bool:
    """Return True if words, in any case, have a body stop as it is."""
    return _FREEZES.search(said.lower()) is not None


def freezes(before: str, action: str, said: str) -> bool:
    """Return True if a body that waits stays in the posture of the way before it.

    Args:
        before: id of the action of the way.
        action: id of the action of the movement behind it; empty = none that is known.
        said: its words, in lower case.
    """
    if action not in ("idle", "") or before not in FREEZES_FROM:
        return False
    return says_frozen(said) or (action == "idle" and before in LOW)


def frozen(before: Float32, frames: int, layout: FeatureLayout) -> JoinedRows | None:
    """Return a way that ends with both feet on the floor, and a body that stays there for so many frames; None if the
    way is too short.

    Args:
        before: features (T, D) of the way, at 20 fps, on the skeleton of HumanML3D.
        frames: of the wait.
        layout: of the features.
    """
    joints = layout.decode(before).astype(np.float64)
    if len(joints) < LEAST:
        return None
    slows = round(SLOWS_S * FPS)
    last = _stands_at(joints)
    begin = last - slows // 2
    time = np.arange(frames + 1)
    # twice the time for half of the frames: from full speed to rest
    at = begin + np.where(time < slows, time - time**2 / (2 * slows), slows / 2)
    body = StandingBody(poses_at(joints, at))
    rests = np.clip((time - slows) / FPS, 0.0, 1.0)
    body.shift(-BREATHS_M * rests * (1 - np.cos(2 * np.pi * BREATHS_HZ * (time - slows) / FPS)))
    features = encode_all(layout, np.concatenate([joints[:begin], body.solved()[:frames]]))
    return JoinedRows(features[:begin], features[begin:], slows)


def _stands_at(joints: Array) -> int:
    """Return the frame near the end in which both feet stand best."""
    feet = joints[:, [joint for leg in LEGS.values() for joint in leg[2:]]]
    speed = np.linalg.norm(np.gradient(feet, axis=0), axis=-1).max(-1) * FPS
    lifted = feet[..., 1].max(-1) - feet[..., 1].max(-1).min()
    first = max(len(joints) - round(LATEST_S * FPS), LEAST // 2)
    return first + int(np.argmin(smooth((speed + 4.0 * lifted)[:, None], 1.0)[first:, 0]))
