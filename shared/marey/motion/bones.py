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

from marey.motion.filters import smoothstep
from marey.motion.rigid import bodies_of
from marey.motion.rotations import Array
from marey.motion.skeleton import Skeleton

STEPS = 4
"""Steps of Newton's method; the pose solver removes what is left, under a millimetre on generated motion."""
DAMPING = 1e-3
"""Share of the diagonal that is added to it: in a flat rigid body, such as the pelvis, one distance follows from the
others."""
LONGEST = 0.1
"""Metres that a joint moves in one step along an axis: joints that are no body stay finite."""
TOE, END, BODY = 0.02, 0.5, 0.2
"""Mobilities of toes, which stand, of hands and head, and of the joints of rigid bodies: pelvis and chest keep the way
that they face. That of other joints is 1, and that of the toes of a leg far from its length, which is in a swing."""
AT_ONCE = 256
"""Frames that are solved together, more than the longest motion of a bundle: each takes 26 kB, so that the memory does
not grow with the length of a timeline."""
NEAR, FAR = 0.02, 0.1
"""Metres by which the bones of a leg are off, all together, up to which its toe stays, and from which it moves."""


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
        mobility[[j for body, ends in bodies_of(skeleton).items() for j in (body, *ends)]] = BODY
        mobility[list(skeleton.feet[1::2])] = TOE
        self._moves = mobility[:, None] * incidence.T  # (J, E)
        self._shared = incidence @ self._moves  # (E, E)
        self._damping = DAMPING * np.diag(np.diag(self._shared))
        self._toes = [(toe, self._leg(skeleton, toe), incidence[:, toe]) for toe in skeleton.feet[1::2]]

    def _leg(self, skeleton: Skeleton, toe: int) -> list[int]:
        """Return the bones from a toe up to the pelvis, among all."""
        chain, ends = [toe], {-1, *bodies_of(skeleton)}
        while skeleton.parents[chain[-1]] not in ends:
            chain.append(skeleton.parents[chain[-1]])
        return [int(np.flatnonzero(self._ends == joint)[0]) for joint in chain[:-1]]

    def fit(self, joints: Array) -> Array:
        """Return joints (T, J, 3) near to the given ones (T, J, 3), in metres, with bones of the skeleton's lengths."""
        parts = (joints[first : first + AT_ONCE] for first in range(0, len(joints), AT_ONCE))
        fitted = [self._fit(np.array(part, np.float64)) for part in parts]
        return np.concatenate(fitted) if fitted else np.array(joints, np.float64)

    def _fit(self, joints: Array) -> Array:
        """Return the joints of some frames, changed in place."""
        off = np.abs(_lengths(self._bones(joints)) - self._lengths)
        far_off = [np.clip((off[:, leg].sum(axis=1) - NEAR) / (FAR - NEAR), 0.0, 1.0) for _, leg, _ in self._toes]
        free = [(1.0 - TOE) * smoothstep(share) for share in far_off]
        shared = self._shared
        for (_, _, edges), share in zip(self._toes, free, strict=True):
            shared = shared + share[:, None, None] * np.outer(edges, edges)
        for _ in range(STEPS):
            bones = self._bones(joints)
            far = _lengths(bones)
            ways = bones / np.maximum(far, 1e-9)[..., None]
            system = (ways @ ways.swapaxes(1, 2)) * shared + self._damping
            push = np.asarray(np.linalg.solve(system, (far - self._lengths)[..., None]), np.float64) * ways
            moves = self._moves @ push
            for (toe, _, edges), share in zip(self._toes, free, strict=True):
                moves[:, toe] += share[:, None] * (edges @ push)
            joints -= np.minimum(np.maximum(moves, -LONGEST), LONGEST)
        return joints

    def _bones(self, joints: Array) -> Array:
        return joints.take(self._ends, 1) - joints.take(self._begins, 1)


def _lengths(bones: Array) -> Array:
    return np.sqrt(np.einsum("tei,tei->te", bones, bones))


@lru_cache(maxsize=16)
def bone_fit(skeleton: Skeleton) -> BoneFit:
    """Return the fit to a skeleton, made once."""
    return BoneFit(skeleton)
