"""Features of a motion that is played faster or slower."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from marey.motion.resample import interpolate

Float32 = NDArray[np.float32]

RATES = ("yaw", "velocity", "velocities")
"""Columns that are moves from a frame to the next."""


def pace_features(features: Float32, slices: Mapping[str, slice], frames: int) -> Float32:
    """Return features (`frames`, D) of the whole motion of features (T, D): the same way in another time.

    Args:
        features: in a layout's own units.
        slices: of the layout; see `FeatureLayout.slices`.
        frames: at least 2.
    """
    times = np.linspace(0, len(features) - 1, frames)
    paced = interpolate(features.astype(np.float64), times)
    for name in RATES:
        paced[:, slices[name]] *= len(features) / frames
    contacts = slices["contacts"]
    paced[:, contacts] = features[np.rint(times).astype(np.intp), contacts]
    return paced.astype(np.float32)
