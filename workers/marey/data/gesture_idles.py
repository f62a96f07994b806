"""Captured idles that gestures are put onto."""

from __future__ import annotations

import random

import numpy as np
from numpy.typing import NDArray

from marey.data.part import Part
from marey.drawing.gesture import SIDES
from marey.posing.standing import ARMS

Array = NDArray[np.floating]

_BASE = "idle"
_LEAST_BASE = 30  # frames of an idle
_STANDS = 0.15  # metres that the hips of an idle may move
_UPRIGHT = 0.88  # metres of the hips over the floor; about 1.0 when upright
_ANKLES = 0.16  # metres over the floor
_HANGS = 0.2  # metres that the wrists are below the shoulders
_ASIDE = 0.42  # metres, horizontal distance of the wrists from the hips


def is_plain_idle(part: Part) -> bool:
    """Return True for an idle that stands upright on both feet without moving away, with both arms down."""
    joints = part.joints
    if part.content != _BASE or len(joints) < _LEAST_BASE:
        return False
    wrists, shoulders = (joints[:, [ARMS[side][k] for side in SIDES]] for k in (3, 1))
    aside = np.linalg.norm((wrists - joints[:, :1])[..., [0, 2]], axis=-1)
    return bool(
        np.ptp(joints[:, 0], axis=0).max() < _STANDS
        and joints[:, 0, 1].min() > _UPRIGHT
        and joints[:, [7, 8], 1].max() < _ANKLES
        and (shoulders - wrists)[..., 1].min() > _HANGS
        and aside.max() < _ASIDE
    )


def of_length(joints: Array, frames: int, rng: random.Random) -> Array:
    """Take `frames` frames of an idle; play a shorter one forward and backward, which suits breath and sway."""
    if len(joints) < frames:
        there_and_back = np.concatenate([joints, joints[-2:0:-1]])
        joints = np.tile(there_and_back, (-(-frames // len(there_and_back)), 1, 1))
    first = rng.randint(0, len(joints) - frames)
    return joints[first : first + frames]
