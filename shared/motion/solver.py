"""Where bones point, to how joints turn, for each frame by itself: the closed forms of the pose solver.

Positions say where bones point, not how they twist. What decides the twist, by joint:

- a joint with several children (pelvis, chest) is a rigid body: the best fit of all its bones (Davenport's q-method,
  Markley & Crassidis 2014, section 5.3.1);
- upper arm and thigh turn so that the elbow or knee bends like the hinge it is. A straight limb has no such plane: its
  frames borrow it from other moments, and where there are none either, from a neutral swing;
- joints between two rigid bodies (the spine) share the twist between those evenly;
- every other joint swings the shortest way from its parent; a joint without children does not turn.

Each bone is aimed from where its joint really comes to lie at where its child should be, so that errors of bone lengths
do not add up along a limb.

Three things need more than one frame, and a `Moments` decides them: `pose.py` from a whole clip, `live_poses.py` from
the past alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Protocol

import numpy as np

from shared.motion.rotations import (
    Array,
    between,
    conjugate,
    cross,
    multiply,
    normalize,
    rotate,
    unroll,
)
from shared.motion.skeleton import Skeleton

# Neutral limb directions of a left limb in its parent's T-pose frame: the middle of what the joint can reach, so that
# the opposite direction, where the shortest swing is not defined, is out of reach (up and back, behind the body).
NEUTRAL_ARM = np.array([0.5, -0.6, 0.6])
NEUTRAL_LEG = np.array([0.1, -0.8, 0.6])
BEND_SEEN = 0.15  # sine of the bend at which a bend plane has half its weight (9 degrees)


class Moments(Protocol):
    """How the rows of one call hang together: successive frames of a clip, or one frame each of live streams."""

    def signs(self, q: Array) -> Array:
        """Rotations (T, 4) with the sign chosen of each."""
        ...

    def bend(self, limb: int, seen: Array) -> Array:
        """(T,) twist of a limb's bend plane against the neutral one.

        Args:
            limb: which limb, by its place in `FrameSolver.limbs`.
            seen: (T, 2) cosine and sine of that twist as each frame shows it, times the weight of that, 0 to 1.
        """
        ...

    def twist(self, chain: int, angles: Array) -> Array:
        """(T,) angles that a spine shares, without jumps; given to a full turn.

        Args:
            chain: which spine, by its place in `FrameSolver.spines`.
            angles: (T,) radians.
        """
        ...


@dataclass(frozen=True)
class Limb:
    """Upper joint with a hinge below: T-pose normal of the bend plane, neutral direction."""

    upper: int
    hinge: int
    end: int
    normal: tuple[float, float, float]
    neutral: tuple[float, float, float]
    one_way: bool  # a knee; an elbow's neutral swing is too rough to tell the sides


class FrameSolver:
    """The solver of one skeleton: `limbs` and `spines` say what its `Moments` are asked about."""

    def __init__(self, skeleton: Skeleton) -> None:
        self.skeleton = skeleton
        self.offsets = skeleton.offsets.astype(np.float64)
        self.limbs = _limbs(skeleton.parents, skeleton.facing)
        self._points = bodies_of(skeleton)
        self._rest = {j: rest_vectors(skeleton, self.offsets, j, points) for j, points in self._points.items()}
        chains = _spines(skeleton.parents, frozenset(self._points))
        self.spines = tuple(chains[j] for j in sorted(chains))
        self._parents = np.array([max(p, 0) for p in skeleton.parents])

    def solve(self, joints: Array, moments: Moments) -> tuple[Array, Array]:
        """Local rotations (T, J, 4), in any sign, and where they put the joints (T, J, 3).

        Args:
            joints: (T, J, 3) float64, finite.
            moments: how the rows hang together.
        """
        world, places = _Pass(self, joints, moments).run()
        local = multiply(conjugate(world[:, self._parents]), world)
        local[:, 0] = world[:, 0]
        return local, places

    def fit(self, j: int, joints: Array) -> Array:
        """(T, 4) best rotation of a rigid body: its T-pose bones onto the bones as they are."""
        return fit_rotation(self._rest[j], joints[:, self._points[j]] - joints[:, j : j + 1])

    def is_body(self, j: int) -> bool:
        """Whether joint j carries several bones."""
        return j in self._points


class _Pass:
    """One pass from the root outwards. `world` (T, J, 4) and `places` (T, J, 3) are filled joint by joint."""

    def __init__(self, solver: FrameSolver, joints: Array, moments: Moments) -> None:
        self.solver = solver
        self.target = joints
        self.moments = moments
        self.tree = solver.skeleton
        self.offsets = solver.offsets
        self.world = np.empty((*joints.shape[:2], 4))
        self.places = np.empty_like(joints)
        self.places[:, 0] = joints[:, 0]

    def run(self) -> tuple[Array, Array]:
        limbs = {limb.upper: k for k, limb in enumerate(self.solver.limbs)}
        spines = {chain[0]: k for k, chain in enumerate(self.solver.spines)}
        in_spines = {j for chain in self.solver.spines for j in chain}
        for j in range(len(self.tree)):
            if j:
                self.places[:, j] = self.places[:, self.tree.parents[j]] + rotate(
                    self.world[:, self.tree.parents[j]], self.offsets[j]
                )
            if j in spines:
                self._spine(spines[j])  # all of the chain at once
            elif j in in_spines:
                continue
            elif self.solver.is_body(j):
                self.world[:, j] = self._body(j)
            elif j in limbs:
                self._limb(limbs[j])
            else:
                self._swing(j)
        return self.world, self.places

    def _parent(self, j: int) -> Array:
        """(T, 4) world rotation of the parent, the identity above the root."""
        p = self.tree.parents[j]
        return self.world[:, p] if p >= 0 else np.tile([1.0, 0.0, 0.0, 0.0], (len(self.target), 1))

    def _direction(self, j: int, child: int) -> Array:
        """(T, 3) from where joint j lies to where its child should."""
        return self.target[:, child] - self.places[:, j]

    def _swing(self, j: int) -> None:
        """The shortest way from the parent that aims the bone at the child."""
        before = self._parent(j)
        children = self.tree.children[j]
        if children:
            swing = between(rotate(before, self.offsets[children[0]]), self._direction(j, children[0]))
            before = multiply(swing, before)
        self.world[:, j] = before

    def _body(self, j: int) -> Array:
        return self.moments.signs(self.solver.fit(j, self.target))

    def _spine(self, number: int) -> None:
        """Joints from below one rigid body up to the next, which share the twist between them."""
        chain = self.solver.spines[number]
        body = chain[-1]
        self.world[:, body] = self._body(body)
        before = self._parent(chain[0])
        swings: list[Array] = []
        for j, child in pairwise(chain):
            if j != chain[0]:
                self.places[:, j] = self.places[:, self.tree.parents[j]] + rotate(before, self.offsets[j])
            before = multiply(between(rotate(before, self.offsets[child]), self._direction(j, child)), before)
            swings.append(before)
        rest = multiply(conjugate(before), self.world[:, body])
        along = np.einsum("ti,i->t", rest[:, 1:], normalize(self.offsets[body]))
        twist = self.moments.twist(number, 2 * np.arctan2(along, rest[:, 0]))
        for k, (j, swing) in enumerate(zip(chain[:-1], swings, strict=True), start=1):
            bone = normalize(self.offsets[chain[k]])
            self.world[:, j] = multiply(swing, _turn(bone, twist * k / len(chain)))

    def _limb(self, number: int) -> None:
        """Upper arm or thigh: aimed at the hinge, and turned so that the hinge bends in its plane."""
        limb = self.solver.limbs[number]
        bone = normalize(self.offsets[limb.hinge])
        neutral = normalize(np.array(limb.neutral))
        upper, lower = self._direction(limb.upper, limb.hinge), self.target[:, limb.end] - self.target[:, limb.hinge]
        upper, lower = normalize(upper), normalize(lower)
        before = self._parent(limb.upper)
        swing = multiply(between(rotate(before, neutral), upper), multiply(before, between(bone, neutral)))
        rest = np.array(limb.normal) - bone * (bone @ limb.normal)
        across = rotate(swing, normalize(rest))  # where the hinge's axis would be, square to `upper`
        axis = cross(upper, lower)  # where it is seen to be, as long as the sine of the bend
        along, beside = np.einsum("ti,ti->t", axis, across), np.einsum("ti,ti->t", axis, cross(upper, across))
        twist = self.moments.bend(number, _evidence(along, beside, limb.one_way))
        self.world[:, limb.upper] = multiply(swing, _turn(bone, twist))


def _evidence(along: Array, beside: Array, one_way: bool) -> Array:
    """(T, 2) what `Moments.bend` is given, from cosine and sine of the twist, both times the sine of the bend."""
    squared = along**2 + beside**2
    weight = squared / (squared + BEND_SEEN**2)
    if one_way:
        weight = weight * (along > 0)
    length = np.sqrt(np.maximum(squared, 1e-18))
    return np.stack([weight * along / length, weight * beside / length], axis=1)


def _turn(axis: Array, angle: Array) -> Array:
    """(T, 4) rotations about one unit axis (3,) by angles (T,)."""
    return np.concatenate([np.cos(angle / 2)[:, None], np.sin(angle / 2)[:, None] * axis], axis=1)


def fit_rotation(rest: Array, seen: Array) -> Array:
    """The rotation that best turns one set of vectors into another, in the sense of least squares.

    Davenport's q-method: the eigenvector of the largest eigenvalue of a symmetric 4 x 4 matrix. Where the vectors leave
    a rotation open (all on one line) the smaller one is taken, by a prior of a billionth.

    Args:
        rest: (K, 3). seen: (T, K, 3).

    Returns:
        (T, 4).
    """
    b = np.einsum("tki,kj->tij", seen, rest)
    b = b + 1e-9 * np.maximum(np.einsum("ki,ki->", rest, rest), 1e-12) * np.eye(3)
    k = np.empty((len(b), 4, 4))
    trace = np.einsum("tii->t", b)
    k[:, 1:, 1:] = b + b.transpose(0, 2, 1) - trace[:, None, None] * np.eye(3)
    k[:, 0, 0] = trace
    z = np.stack([b[:, 2, 1] - b[:, 1, 2], b[:, 0, 2] - b[:, 2, 0], b[:, 1, 0] - b[:, 0, 1]], axis=1)
    k[:, 0, 1:] = z
    k[:, 1:, 0] = z
    return unroll(np.linalg.eigh(k)[1][:, :, -1])


def rest_vectors(skeleton: Skeleton, offsets: Array, j: int, points: tuple[int, ...]) -> Array:
    """(K, 3) from joint j to its descendants in the T-pose."""
    return np.stack([_rest_vector(skeleton, offsets, j, k) for k in points])


def _rest_vector(skeleton: Skeleton, offsets: Array, j: int, k: int) -> Array:
    """(3,) from joint j to its descendant k in the T-pose."""
    vector = np.zeros(3)
    while k != j:
        vector, k = vector + offsets[k], skeleton.parents[k]
    return vector


def bodies_of(skeleton: Skeleton) -> dict[int, tuple[int, ...]]:
    """Joints with several bones, and their ends; a child at no distance (SnapMoGen's pelvis) is the same body."""
    lengths = np.linalg.norm(skeleton.offsets, axis=-1)

    def points(j: int) -> tuple[int, ...]:
        found: list[int] = []
        for child in skeleton.children[j]:
            found.extend((child,) if lengths[child] > 1e-6 else points(child))
        return tuple(found)

    every = {j: points(j) for j in range(len(skeleton)) if j == 0 or lengths[j] > 1e-6}
    return {j: found for j, found in every.items() if len(found) > 1}


@lru_cache(maxsize=64)
def _limbs(parents: tuple[int, ...], facing: tuple[int, ...]) -> tuple[Limb, ...]:
    """Arms and legs of a skeleton that knows its hips and shoulders.

    Normals in the T-pose: a knee bends about +X; an elbow takes the hand forward, about Y, the two sides opposite.
    """
    limbs: list[Limb] = []
    for upper, arm, side in zip(facing, (False, False, True, True), (-1, 1, -1, 1), strict=False):
        hinges = [j for j, p in enumerate(parents) if p == upper]
        ends = [j for j, p in enumerate(parents) if hinges and p == hinges[0]]
        if len(hinges) == 1 and len(ends) == 1:
            x, y, z = NEUTRAL_ARM if arm else NEUTRAL_LEG
            normal = (0.0, -1.0 * side, 0.0) if arm else (1.0, 0.0, 0.0)
            limbs.append(Limb(upper, hinges[0], ends[0], normal, (side * x, y, z), one_way=not arm))
    return tuple(limbs)


@lru_cache(maxsize=64)
def _spines(parents: tuple[int, ...], bodies: frozenset[int]) -> dict[int, tuple[int, ...]]:
    """Chains between two rigid bodies by their first joint: (first, …, last, body above)."""
    chains: dict[int, tuple[int, ...]] = {}
    for body in bodies:
        chain = [body]
        while parents[chain[0]] >= 0 and parents[chain[0]] not in bodies:
            chain.insert(0, parents[chain[0]])
        if len(chain) > 1 and parents[chain[0]] >= 0:
            chains[chain[0]] = tuple(chain)
    return chains
