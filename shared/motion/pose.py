"""Joint positions to joint rotations, without a search: every step is a closed form over all frames at once.

Positions say where bones point, not how they twist. What decides the twist, by joint:

- a joint with several children (pelvis, chest) is a rigid body: the best fit of all its bones (Davenport's q-method,
  Markley & Crassidis 2014, section 5.3.1);
- upper arm and thigh turn so that the elbow or knee bends like the hinge it is. A straight limb has no such plane: its
  frames borrow it from their neighbours in time, and where there are none either, from a neutral swing;
- joints between two rigid bodies (the spine) share the twist between those evenly;
- every other joint swings the shortest way from its parent; a joint without children does not turn.

Each bone is aimed from where its joint really comes to lie at where its child should be, so that errors of bone lengths
do not add up along a limb.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from itertools import pairwise

import numpy as np

from shared.errors import InvalidInput
from shared.motion.filters import smooth
from shared.motion.kinematics import bone_lengths
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
PLANE_SECONDS = 0.1  # standard deviation of the smoothing of bend planes in time
PLANE_PRIOR = 0.05  # weight of the neutral swing beside a fully visible bend plane (1)
BEND_SEEN = 0.15  # sine of the bend at which a bend plane has half its weight (9 degrees)


@dataclass(frozen=True, eq=False)
class Pose:
    """Rotations of a skeleton over time.

    Attributes:
        skeleton: the tree, with the bone lengths that were solved for.
        rotations: (T, J, 4) float64 local quaternions, continuous in sign.
        root: (T, 3) position of joint 0.
        joints: (T, J, 3) where they put the joints.
    """

    skeleton: Skeleton
    rotations: Array = field(repr=False)
    root: Array = field(repr=False)
    joints: Array = field(repr=False)

    @property
    def offsets(self) -> Array:
        """(J, 3) the T-pose with this body's proportions."""
        return self.skeleton.offsets


@dataclass(frozen=True)
class _Limb:
    """Upper joint with a hinge below: T-pose normal of the bend plane, neutral direction."""

    upper: int
    hinge: int
    end: int
    normal: tuple[float, float, float]
    neutral: tuple[float, float, float]
    one_way: bool  # a knee; an elbow's neutral swing is too rough to tell the sides


def solve_pose(joints: Array, skeleton: Skeleton, *, fps: float = 20.0, measure: bool = True) -> Pose:
    """Local rotations that put a skeleton where the joints are.

    Args:
        joints: (T, J, 3) metres.
        skeleton: its T-pose gives the directions of the bones.
        fps: frames a second, for the time constants.
        measure: take the bone lengths from the joints (`measure_offsets`); otherwise those of the skeleton.

    Returns:
        A pose with constant bone lengths.

    Raises:
        InvalidInput: wrong shape, or numbers that are not finite.
    """
    joints = np.asarray(joints, np.float64)
    if joints.ndim != 3 or joints.shape[1:] != (len(skeleton), 3) or not len(joints):
        raise InvalidInput(f"joints have shape {joints.shape}, not (T, {len(skeleton)}, 3)", where=skeleton.name)
    if not np.isfinite(joints).all():
        raise InvalidInput("joints hold NaN or infinite numbers", where=skeleton.name)
    if measure:
        skeleton = skeleton.with_offsets(measure_offsets(joints, skeleton))
    solver = _Solver(joints, skeleton, fps)
    parents = np.array([max(p, 0) for p in skeleton.parents])
    local = multiply(conjugate(solver.world[:, parents]), solver.world)
    local[:, 0] = solver.world[:, 0]
    return Pose(skeleton, unroll(local), joints[:, 0].copy(), solver.places)


class _Solver:
    """One pass from the root outwards. `world` (T, J, 4) and `places` (T, J, 3) are filled joint by joint."""

    def __init__(self, joints: Array, skeleton: Skeleton, fps: float) -> None:
        self.target = joints
        self.tree = skeleton
        self.fps = fps
        self.offsets = skeleton.offsets.astype(np.float64)
        self.world = np.empty((*joints.shape[:2], 4))
        self.places = np.empty_like(joints)
        self.places[:, 0] = joints[:, 0]
        limbs = {limb.upper: limb for limb in _limbs(skeleton.parents, skeleton.facing)}
        bodies = _bodies(skeleton)
        spines = _spines(skeleton.parents, frozenset(bodies))
        in_spines = {j for chain in spines.values() for j in chain}
        for j in range(len(skeleton)):
            if j:
                self.places[:, j] = self.places[:, skeleton.parents[j]] + rotate(
                    self.world[:, skeleton.parents[j]], self.offsets[j]
                )
            if j in spines:
                self._spine(spines[j], bodies)  # all of the chain at once
            elif j in in_spines:
                continue
            elif j in bodies:
                self.world[:, j] = self._body(j, bodies[j])
            elif j in limbs:
                self._limb(limbs[j])
            else:
                self._swing(j)

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

    def _body(self, j: int, points: tuple[int, ...]) -> Array:
        """(T, 4) best rotation of a rigid body: its T-pose bones onto the bones as they are."""
        rest = np.stack([_rest_vector(self.tree, self.offsets, j, k) for k in points])
        return fit_rotation(rest, self.target[:, points] - self.target[:, j : j + 1])

    def _spine(self, chain: tuple[int, ...], bodies: dict[int, tuple[int, ...]]) -> None:
        """Joints from below one rigid body up to the next, which share the twist between them."""
        body = chain[-1]
        self.world[:, body] = self._body(body, bodies[body])
        before = self._parent(chain[0])
        swings: list[Array] = []
        for j, child in pairwise(chain):
            if j != chain[0]:
                self.places[:, j] = self.places[:, self.tree.parents[j]] + rotate(before, self.offsets[j])
            before = multiply(between(rotate(before, self.offsets[child]), self._direction(j, child)), before)
            swings.append(before)
        rest = multiply(conjugate(before), self.world[:, body])
        axis = normalize(self.offsets[body])
        twist = _unwrap(2 * np.arctan2(rest[:, 1:] @ axis, rest[:, 0]))
        for k, (j, swing) in enumerate(zip(chain[:-1], swings, strict=True), start=1):
            bone = normalize(self.offsets[chain[k]])
            self.world[:, j] = multiply(swing, _turn(bone, twist * k / len(chain)))

    def _limb(self, limb: _Limb) -> None:
        """Upper arm or thigh: aimed at the hinge, and turned so that the hinge bends in its plane."""
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
        self.world[:, limb.upper] = multiply(swing, _turn(bone, self._plane(along, beside, limb.one_way)))

    def _plane(self, along: Array, beside: Array, one_way: bool) -> Array:
        """(T,) twist of the bend plane against the neutral one, from its cosine and sine times the sine of the bend."""
        squared = along**2 + beside**2
        weight = squared / (squared + BEND_SEEN**2)
        if one_way:
            weight = weight * (along > 0)
        length = np.sqrt(np.maximum(squared, 1e-18))
        seen = smooth(np.stack([weight * along / length, weight * beside / length], axis=1), PLANE_SECONDS * self.fps)
        twist = _unwrap(np.arctan2(seen[:, 1], seen[:, 0] + PLANE_PRIOR))
        return smooth(twist[:, None], 0.5 * PLANE_SECONDS * self.fps)[:, 0]


def _unwrap(angles: Array) -> Array:
    """(T,) angles without jumps, in the full turn around zero that holds most of them."""
    unwrapped = np.asarray(np.unwrap(angles), np.float64)
    return unwrapped - 2 * np.pi * np.round(np.median(unwrapped) / (2 * np.pi))


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


def measure_offsets(joints: Array, skeleton: Skeleton) -> Array:
    """The T-pose with the proportions of a moving body.

    Single bones keep the direction of the skeleton's T-pose and take the median of their lengths over time; rigid
    bodies (pelvis, chest) take the median place of their points in the body's own frame; all is made symmetrical.

    Args:
        joints: (T, J, 3) metres.

    Returns:
        (J, 3) float64.
    """
    template = skeleton.offsets.astype(np.float64)
    lengths = np.median(bone_lengths(joints, skeleton), axis=0)
    offsets = normalize(template) * lengths[:, None]
    for j, points in _bodies(skeleton).items():
        seen = joints[:, points] - joints[:, j : j + 1]
        rest = np.stack([_rest_vector(skeleton, template, j, k) for k in points])
        # The template has other proportions, so the first fit is in another frame than the last, but in one frame for
        # all time: what is measured in it is the body, turned. The second fit turns it back to the template.
        turns = fit_rotation(rest, seen)
        body = np.median(rotate(conjugate(turns)[:, None], seen), axis=0)
        body = rotate(conjugate(fit_rotation(rest, body[None]))[0], body)
        for place, k in zip(body, points, strict=True):
            if skeleton.parents[k] == j:
                offsets[k] = place
    mirrored = offsets[list(skeleton.mirror)] * [-1.0, 1.0, 1.0]
    offsets = 0.5 * (offsets + mirrored)
    offsets[0] = template[0]
    standing = skeleton.with_offsets(offsets).rest[:, 1].min()
    offsets[0, 1] += skeleton.rest[:, 1].min() - standing  # longer legs stand the root higher over the floor
    return offsets


def _rest_vector(skeleton: Skeleton, offsets: Array, j: int, k: int) -> Array:
    """(3,) from joint j to its descendant k in the T-pose."""
    vector = np.zeros(3)
    while k != j:
        vector, k = vector + offsets[k], skeleton.parents[k]
    return vector


def _bodies(skeleton: Skeleton) -> dict[int, tuple[int, ...]]:
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
def _limbs(parents: tuple[int, ...], facing: tuple[int, ...]) -> tuple[_Limb, ...]:
    """Arms and legs of a skeleton that knows its hips and shoulders.

    Normals in the T-pose: a knee bends about +X; an elbow takes the hand forward, about Y, the two sides opposite.
    """
    limbs: list[_Limb] = []
    for upper, arm, side in zip(facing, (False, False, True, True), (-1, 1, -1, 1), strict=False):
        hinges = [j for j, p in enumerate(parents) if p == upper]
        ends = [j for j, p in enumerate(parents) if hinges and p == hinges[0]]
        if len(hinges) == 1 and len(ends) == 1:
            x, y, z = NEUTRAL_ARM if arm else NEUTRAL_LEG
            normal = (0.0, -1.0 * side, 0.0) if arm else (1.0, 0.0, 0.0)
            limbs.append(_Limb(upper, hinges[0], ends[0], normal, (side * x, y, z), one_way=not arm))
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
