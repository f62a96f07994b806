"""The body around the 22 joints of HumanML3D: how high over the floor a joint is when its part of the body lies on it.

A toe joint stands at height 0, as the data set has it, and an ankle over a flat sole at 6 cm. Other radii are those of
an adult of 1.73 m: in a body that sits on the floor the hips are 9 cm over it, in one that kneels the knees 5 cm.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from marey.motion.skeleton import HUMANML3D

_RADIUS = {
    "pelvis": 0.100,
    "hip": 0.090,
    "knee": 0.050,
    "ankle": 0.060,
    "foot": 0.000,
    "spine1": 0.105,
    "spine2": 0.110,
    "spine3": 0.110,
    "neck": 0.060,
    "collar": 0.080,
    "head": 0.085,
    "shoulder": 0.060,
    "elbow": 0.040,
    "wrist": 0.035,
}
RADII: NDArray[np.float64] = np.array([_RADIUS[name.split("_")[-1]] for name in HUMANML3D.joint_names])
"""(22,) metres."""


def clearance(joints: NDArray[np.floating]) -> NDArray[np.float64]:
    """(..., T) metres between the floor and the lowest part of a body (..., T, 22, 3); negative: it is under it."""
    return np.asarray((np.asarray(joints, np.float64)[..., 1] - RADII).min(axis=-1))
