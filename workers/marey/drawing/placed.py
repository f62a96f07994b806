"""Bodies that are turned and moved over feet which are placed independently."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from marey.posing.bones import knee_poles, with_bones
from marey.posing.limbs import CARRIED, LEG_CHAINS, PARENTS

Array = NDArray[np.floating]

_AHEAD = {3: 0.2, 6: 0.4, 9: 0.7}  # share by which the spine is turned like the shoulders


def posed(joints: Array, root: Array, yaw: Array, toes: Array, toe_yaw: Array) -> Array:
    """Turn and move a body whose feet are placed independently.

    Args:
        joints: (T, 22, 3) metres.
        root: (T, 3) new places of the root.
        yaw: (T, 22) radians by which the bone that ends in each joint is turned about the vertical; legs: the hips.
        toes: (T, 2, 3) new places of the toes.
        toe_yaw: (T, 2) radians by which the feet are turned.
    """
    bones = joints - joints[:, PARENTS]
    poles = knee_poles(joints)
    out = np.empty_like(joints)
    out[:, 0] = root
    for j in CARRIED[1:]:
        out[:, j] = out[:, PARENTS[j]] + about_vertical(bones[:, j], yaw[:, j])
    for side, (hip, knee, ankle, toe) in enumerate(LEG_CHAINS):
        out[:, toe] = toes[:, side]
        out[:, ankle] = toes[:, side] - about_vertical(bones[:, toe], toe_yaw[:, side])
        pole = about_vertical(poles[:, side], (yaw[:, hip] + toe_yaw[:, side]) / 2)
        out[:, knee] = (out[:, hip] + out[:, ankle]) / 2 + 0.1 * pole
    return with_bones(out)


def about_vertical(vectors: Array, yaw: Array) -> Array:
    """Turn vectors (..., 3) by radians (...) about the vertical; positive is to the left."""
    cos, sin = np.cos(yaw), np.sin(yaw)
    x, y, z = np.moveaxis(vectors, -1, 0)
    return np.stack([cos * x + sin * z, y, cos * z - sin * x], axis=-1)


def spine_yaw(hips: Array, shoulders: Array) -> Array:
    """Turning (T, 22) of each bone from that of the hips and that of the shoulders (T,)."""
    share = np.ones(22)
    share[[1, 2]] = 0.0
    share[list(_AHEAD)] = list(_AHEAD.values())
    return hips[:, None] + (shoulders - hips)[:, None] * share
