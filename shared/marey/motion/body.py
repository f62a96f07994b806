"""The one body of a bundle: every motion of a bundle has its skeleton, clips and live streams alike.

`standard` is the skeleton of the training data, scaled uniformly to a height of 1.75 m. All lengths are whole
micrometres, so that a skeleton that went through JSON is equal to the last bit.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from marey.motion.export_options import STANDARD as STANDARD
from marey.motion.skeleton import Skeleton

STATURE = 1.75
"""Metres from the sole to the top of the head."""
_STATURE_OF_SPAN = 1.73 / 1.555
"""Stature over the distance from the toes to the head joint in the T-pose, of `humanml3d`."""
DIGITS = 6
"""Decimals of a metre."""


@dataclass(frozen=True, eq=False)
class NamedBody:
    """A skeleton that motions are solved onto.

    Attributes:
        name: `standard`, or the name of a file.
        skeleton: with the offsets of this body, metres.
    """

    name: str
    skeleton: Skeleton

    @cached_property
    def sha256(self) -> str:
        """Hash of the JSON of names, parents and offsets: equal hashes mean equal skeletons."""
        tree = self.skeleton
        places = [[round(float(x), DIGITS) + 0.0 for x in offset] for offset in tree.offsets]
        content = {"names": tree.joint_names, "parents": tree.parents, "offsets": places}
        return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()

    def describe(self) -> dict[str, str]:
        """Return the record of the body in a motion's manifest."""
        return {"name": self.name, "sha256": self.sha256}


def stature(skeleton: Skeleton) -> float:
    """Return the height in metres of a body in its T-pose, from the sole to the top of the head."""
    heights = skeleton.rest[:, 1].astype(np.float64)
    return float(np.ptp(heights)) * _STATURE_OF_SPAN


@lru_cache(maxsize=16)
def standard_body(training: Skeleton) -> NamedBody:
    """Return the body `standard` of bundles that were trained on a skeleton."""
    scaled = STATURE / stature(training) * training.offsets.astype(np.float64)
    return NamedBody(STANDARD, training.with_offsets(np.round(scaled, DIGITS) + 0.0))  # no -0.0


def travel_scale(training: Skeleton, body: Skeleton) -> float:
    """Return how much farther a body steps than the skeleton of the training data: the ratio of their leg lengths, from
    the hips to the floor."""
    return _hip_height(body) / _hip_height(training)


def _hip_height(skeleton: Skeleton) -> float:
    heights = skeleton.rest[:, 1].astype(np.float64)
    hips = heights[list(skeleton.facing[:2])].mean() if skeleton.facing else heights[0]
    return float(hips - heights.min())
