"""Features with left and right exchanged, without a detour by joints."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from marey.motion.skeleton import OTHER_FOOT, Skeleton

Float32 = NDArray[np.float32]

_ACROSS = np.array([-1, 1, 1], np.float32)
"""A point or velocity mirrored at the plane between left and right."""
_ACROSS_6D = np.array([1, -1, -1, -1, 1, 1], np.float32)
"""M R M for M = diag(-1, 1, 1), of the first two columns of a rotation matrix R."""


def mirror_features(features: Float32, slices: Mapping[str, slice], skeleton: Skeleton) -> Float32:
    """Return features (..., T, D) of the mirrored motion: what `encode` makes of `mirror_joints`.

    Args:
        features: in the layout's own units, not normalized.
        slices: of the layout, with groups yaw, velocity (x, z), height, positions, rotations, velocities, contacts. A
            group of one joint fewer than the skeleton's leaves out the root.
        skeleton: of the layout.
    """
    mirrored = np.array(features, np.float32)
    mirrored[..., slices["yaw"]] *= -1
    mirrored[..., slices["velocity"]] *= _ACROSS[[0, 2]]
    mirrored[..., slices["contacts"]] = features[..., slices["contacts"]][..., OTHER_FOOT]
    for name, signs in (("positions", _ACROSS), ("rotations", _ACROSS_6D), ("velocities", _ACROSS)):
        block = features[..., slices[name]]
        rows = block.reshape(*block.shape[:-1], -1, len(signs))
        without = len(skeleton) - rows.shape[-2]
        other = np.array(skeleton.mirror[without:]) - without
        mirrored[..., slices[name]] = (rows[..., other, :] * signs).reshape(block.shape)
    return mirrored
