"""Nearest joints that have bones of given lengths: the projection of a decoder's joints onto one skeleton.

A decoder's bones change their length from frame to frame and from clip to clip. Here all joints of a frame move
together, as little as possible, until every bone has the skeleton's length: a forearm that is 3 cm too long is
shortened at both ends. It is Newton's method on all constraints at once (SHAKE, Ryckaert et al. 1977, solves them in
turn); each frame is solved by itself.
"""

from __future__ import annotations

from functools import lru_cache
from itertools import combinations

import numpy as np

from marey.motion.rigid import bodies_of
from marey.motion.rotations import Array
from marey.motion.skeleton import Skeleton

STEPS = 3
"""Steps of Newton's method; the pose solver removes what is left, under a millimetre on generated motion."""
DAMPING = 1e-3
"""Share of the diagonal that is added to it: in a flat rigid body, such as the pelvis, one distance follows from the
others."""
LONGEST = 0.1
"""Metres that a joint moves in one step along an axis: joints that are no body stay finite."""
TOE, END = 0.02, 0.5
"""Mobilities of toes, which stand, and of hands and head; that of other joints is 1."""


class BoneFit:
    """Moves joints until the bones have the lengths of one skeleton.

    Args:
        skeleton: its offsets are the bones, in metres.
    """

    def __init__(self, skeleton: Skeleton) -> None:
        bones = [(p, j) for j, p in enumerate(skeleton.parents) if p >= 0]
        within = (pair for ends in bodies_of(skeleton).values() for pair in combinations(ends, 2))
        self._begins, self._ends = np.array([*bones, *within], np.intp).reshape(-1, 2).T  # (E,)
        rest = skeleton.rest.astype(np.float64)
        self._lengths = np.linalg.norm(rest[self._ends] - rest[self._begins], axis=-1)  # (E,) metres
        edges, joints = np.arange(len(self._lengths)), len(skeleton)
        incidence = np.zeros((len(edges), joints))
        incidence[edges, self._ends], incidence[edges, self._begins] = 1.0, -1.0
        mobility = np.array([1.0 if skeleton.children[j] else END for j in range(joints)])
        mobility[list(skeleton.feet[1::2])] = TOE
        self._moves = mobility[:, None] * incidence.T  # (J, E)
        self._shared = incidence @ self._moves  # (E, E)
        self._damping = DAMPING * np.diag(np.diag(self._shared))

    def fit(self, joints: Array) -> Array:
        """Return joints (T, J, 3) near to the given ones (T, J, 3), in metres, with bones of the skeleton's lengths."""
        joints = np.array(joints, np.float64)
        for _ in range(STEPS):
            bones = joints.take(self._ends, 1) - joints.take(self._begins, 1)
            far = np.sqrt(np.einsum("tei,tei->te", bones, bones))
            ways = bones / np.maximum(far, 1e-9)[..., None]
            system = (ways @ ways.swapaxes(1, 2)) * self._shared + self._damping
            push = np.asarray(np.linalg.solve(system, (far - self._lengths)[..., None]), np.float64)
            joints -= np.minimum(np.maximum(self._moves @ (push * ways), -LONGEST), LONGEST)
        return joints


@lru_cache(maxsize=16)
def bone_fit(skeleton: Skeleton) -> BoneFit:
    """Return the fit to a skeleton, made once."""
    return BoneFit(skeleton)
