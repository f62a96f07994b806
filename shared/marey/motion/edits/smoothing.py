"""Low-pass filter over time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from marey.motion.clip import MotionClip
from marey.motion.edits.feet import found_contacts
from marey.motion.edits.place import posed
from marey.motion.filters import smooth
from marey.motion.rotations import Array, normalize, unroll


def low_pass(clip: MotionClip, values: Mapping[str, Any]) -> MotionClip:
    """Remove movement faster than `hz` with a Gaussian, which has half the power there and no delay.

    The first and the last pose stay as they are. Contacts are found again.
    """
    sigma = np.sqrt(np.log(2.0)) / (2 * np.pi * values["hz"]) * clip.fps
    turns = unroll(clip.rotations.astype(np.float64))
    rotations = normalize(_filtered(turns.reshape(clip.frames, -1), sigma).reshape(turns.shape))
    result = posed(clip, rotations, _filtered(clip.root.astype(np.float64), sigma))
    return replace(result, contacts=found_contacts(result))


def _filtered(values: Array, sigma: float) -> Array:
    """Return values (T, C) filtered; beyond its ends the curve goes on, turned by half a turn about its last point."""
    reach = min(int(3 * sigma + 0.5) + 1, len(values) - 1)
    if reach < 1:
        return values
    before = 2 * values[:1] - values[reach:0:-1]
    after = 2 * values[-1:] - values[-2 : -reach - 2 : -1]
    return smooth(np.concatenate([before, values, after]), sigma)[reach:-reach]
