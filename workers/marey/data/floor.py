"""The floor of a clip: under whatever supports the body."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from marey.motion.support import RADII

Array = NDArray[np.floating]
_FEET = [7, 8, 10, 11]
PERCENTILE = 2
"""Of the frames, in which the body may pass under the floor."""
_NEAR = (-0.3, 0.08)  # metres: bodies lie on flesh that radii do not know; higher is in the air


def on_floor(joints: Array, rule: Literal["support", "feet", "file"]) -> Array:
    """The clip (T, 22, 3) with its floor at height 0.

    `support`: no part of the body but for the lowest 2 % of the frames is lower than its radius over the floor, so
    that people lie, crawl and stand on their hands upon it; `feet`: the same for the joints of the feet alone; `file`:
    as `support` where that is near height 0 of the file; else the floor is there, as under a leap that never lands.
    """
    out = np.array(joints, np.float64)
    lowest = out[:, _FEET, 1] if rule == "feet" else out[..., 1] - RADII
    floor = np.percentile(lowest.min(axis=1), PERCENTILE)
    if rule != "file" or _NEAR[0] < floor < _NEAR[1]:
        out[..., 1] -= floor
    return out
