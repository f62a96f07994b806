"""Solve joint rotations from bone directions, each frame by itself: the closed forms of the pose solver.

Positions determine where bones point, not how they twist. The twist is decided by kind of joint:

- a joint with several children (pelvis, chest) is a rigid body: the best fit of all its bones (Davenport's q-method,
  Markley & Crassidis 2014, section 5.3.1);
- upper arm and thigh turn so that the elbow or knee bends as a hinge. A straight limb shows no such plane: its frames
use
  that of other moments, and without any, a neutral swing;
- joints between two rigid bodies (the spine) share the twist between those evenly;
- elbows and knees swing from half a bend of their hinge, every other joint from its parent, the shortest way; a joint
  without children does not turn (`ends.py` turns toes and hands of finished clips).

Each bone is aimed from its joint's solved position at its child's target, so that errors of bone lengths do not add up
along a limb.

Three decisions need more than one frame, and a `Moments` takes them: `pose.py` from a whole clip, `live_poses.py` from
the past alone.

The cost of a single frame is numpy calls, not arithmetic. So joints that are ready at the same time and turn in the
same way form a group that is turned at once: all rigid bodies, arms and legs, elbows and knees.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from marey.motion.rigid import BodyFit, bodies_of
from marey.motion.rotations import (
    IDENTITY,
    Array,
    aimed,
    between,
    conjugate,
    cross,
    dot,
    length,
    multiply,
    normalize,
    rotate,
)
from marey.motion.skeleton import Skeleton

# Neutral limb directions of a left limb in its parent's T-pose frame: the middle of what the joint can reach, so that
# the opposite direction, where the shortest swing is not defined, is out of reach (up and back, behind the body).
NEUTRAL_ARM = np.array([0.5, -0.6, 0.6])
NEUTRAL_LEG = np.array([0.1, -0.8, 0.6])
HALF_BENT = np.radians(80.0)
"""Bend from which elbows and knees swing, the middle of what they can reach: from a straight one the shortest way to a
folded one is nearly half a turn, and not defined."""
BEND_SEEN = 0.15  # sine of the bend at which a bend plane has half its weight (9 degrees)


class Moments(Protocol):
    """Port that relates the rows of one call: successive frames of a clip, or one frame each of live streams."""

    def signs(self, q: Array) -> Array:
        """Return rotations (T, B, 4) of rigid bodies with a chosen sign."""
        ...

    def bend(self, limb: int, seen: Array) -> Array:
        """Return the twist (T,) of a limb's bend plane against the neutral one, radians.

        Args:
            limb: index in `FrameSolver.limbs`.
            seen: (T, 2) cosine and sine of that twist as each frame shows it, times its weight, 0 to 1.
        """
        ...

    def twist(self, chain: int, angles: Array) -> Array:
        """Return the angles (T,) that a spine shares, without jumps; the input is known up to full turns.

        Args:
            chain: index in `FrameSolver.spines`.
            angles: (T,) radians.
        """
        ...


@dataclass(frozen=True)
class HingeLimb:
    """Upper joint with a hinge below: T-pose normal of the bend plane, neutral direction."""

    upper: int
    hinge: int
    end: int
    normal: tuple[float, float, float]
    neutral: tuple[float, float, float]
    one_way: bool  # a knee; an elbow's neutral swing is too inexact to tell the sides


class FrameSolver:
    """The solver of one skeleton; its `Moments` receive indices into `limbs` and `spines`."""

    def __init__(self, skeleton: Skeleton) -> None:
        self.skeleton = skeleton
        self.offsets = skeleton.offsets.astype(np.float64)
        self.limbs = _limbs(skeleton.parents, skeleton.facing)
        bodies = bodies_of(skeleton)
        chains = _spines(skeleton.parents, frozenset(bodies))
        self.spines = tuple(chains[j] for j in sorted(chains))
        self._parents = np.array(skeleton.parents)
        self._bodies = BodyFit(skeleton, self.offsets, bodies) if bodies else None
        self._groups = tuple(self._in_order(bodies))

    def solve(self, joints: Array, moments: Moments) -> tuple[Array, Array]:
        """Solve local rotations (T, J, 4), in any sign, and the resulting joints (T, J, 3) in metres.

        Args:
            joints: (T, J, 3) float64, finite, metres.
            moments: relation between the rows.
        """
        rows = _Rows(joints, moments)
        if self._bodies:
            rows.world[:, self._bodies.joints] = moments.signs(self._bodies.fit(joints))
        for group in self._groups:
            group.turn(rows)
        local = multiply(conjugate(rows.world.take(self._parents, 1)), rows.world[:, :-1])
        return np.ascontiguousarray(local), rows.places

    def places(self, joints: Array) -> Array:
        """Return the joint positions (T, J, 3) that `solve` would give, whatever the moments are, in a fifth of its
        time.

        A rigid body carries its bones, every other bone points from its joint's solved position at its child's target,
        and no joint moves when a bone twists. (A joint with several bones that is not a body, such as SnapMoGen's
        pelvis, aims all of them here; `solve` can aim one.)
        Args:
            joints: (T, J, 3) float64, finite, metres.
        """
        places = np.empty_like(joints)
        places[:, 0] = joints[:, 0]
        carried = self._bodies.carry(joints) if self._bodies else joints
        for bones in self._bones:
            above = places.take(bones.parents, 1)
            if len(bones.carried):
                places[:, bones.joints] = above + carried.take(bones.carried, 1)
            else:
                places[:, bones.joints] = above + bones.aim(joints.take(bones.joints, 1) - above)
        return places

    def _in_order(self, bodies: Mapping[int, object]) -> Iterator[_Group]:
        """Return groups from the root outwards. Limbs wait until no other joint can be turned, so that the legs, which
        are ready first, share a group with the arms; joints without children come last."""
        limbs = {limb.upper: number for number, limb in enumerate(self.limbs)}
        above = {j: child for chain in self.spines for j, child in pairwise(chain)}
        tops = {chain[-2]: number for number, chain in enumerate(self.spines)}
        children = self.skeleton.children

        def rank(j: int) -> int:
            return 0 if j in above else 1 if j in bodies else 3 if j in limbs else 2 if children[j] else 4

        for joints in _rounds(self.skeleton.parents, rank):
            match rank(joints[0]):
                case 0:
                    yield _Swings(self, joints, [above[j] for j in joints])
                    yield from (_Twists(self, tops[j]) for j in joints if j in tops)
                case 1:
                    yield _Bodies(self, joints)
                case 2:
                    yield _Swings(self, joints, [children[j][0] for j in joints])
                case 3:
                    yield _Limbs(self, [limbs[j] for j in joints])
                case _:
                    yield _Ends(self, joints)

    @cached_property
    def _bones(self) -> tuple[_Bones, ...]:
        """Return joints below the root, outwards: carried ones before aimed ones."""
        children = self._bodies.children if self._bodies else []
        _, *rounds = _rounds(self.skeleton.parents, lambda j: 0 if j in children else 1)
        return tuple(_Bones(self, joints, children) for joints in rounds)


def _rounds(parents: Sequence[int], rank: Callable[[int], int]) -> Iterator[list[int]]:
    """Yield lists of joints, from the root outwards: of those with parents in earlier lists, all of the lowest rank."""
    waiting, done = list(range(len(parents))), {-1}
    while waiting:
        ready = [j for j in waiting if parents[j] in done]
        lowest = min(map(rank, ready))
        done.update(j for j in ready if rank(j) == lowest)
        yield [j for j in ready if j in done]
        waiting = [j for j in waiting if j not in done]


class _Rows:
    """The T rows of one call, filled from the root outwards.

    Attributes:
        target: (T, J, 3) target positions, metres.
        places: (T, J, 3) solved positions, metres.
        world: (T, J + 1, 4) world rotations; the last is the identity, the parent of the root.
    """

    def __init__(self, target: Array, moments: Moments) -> None:
        self.target = target
        self.moments = moments
        self.places = np.empty_like(target)
        self.places[:, 0] = target[:, 0]
        self.world = np.empty((len(target), target.shape[1] + 1, 4))
        self.world[:, -1] = IDENTITY


class _Joints:
    """G joints that are solved at once, after their parents."""

    def __init__(self, solver: FrameSolver, joints: Sequence[int]) -> None:
        self.joints = np.array(joints)  # (G,)
        self.parents = np.array([solver.skeleton.parents[j] for j in joints])  # (G,)
        self.offsets = solver.offsets[None, self.joints]  # (1, G, 3)


class _Bones(_Joints):
    """Joints at the ends of bones, which rigid bodies carry or which are aimed."""

    def __init__(self, solver: FrameSolver, joints: Sequence[int], children: Sequence[int]) -> None:
        super().__init__(solver, joints)
        self.carried = np.array([children.index(j) for j in joints if j in children], np.intp)  # (G,), or none
        self.lengths = length(self.offsets)[..., None]  # (1, G, 1)

    def aim(self, ways: Array) -> Array:
        """Return bones (T, G, 3) along the ways (T, G, 3) from their start to their target; as in the T-pose where a
        way has no length and thus no direction."""
        far = length(ways)[..., None]
        seen = far > 0
        return np.where(seen, ways * (self.lengths / np.where(seen, far, 1.0)), self.offsets)


class _Group(_Joints, ABC):
    """Joints that turn in the same way."""

    def place(self, rows: _Rows) -> Array:
        """Put the joints where their parents take them; return the parents' world rotations (T, G, 4)."""
        before = rows.world.take(self.parents, 1)
        if self.parents[0] >= 0:  # the root is at its target
            rows.places[:, self.joints] = rows.places.take(self.parents, 1) + rotate(before, self.offsets)
        return before

    @abstractmethod
    def turn(self, rows: _Rows) -> None:
        """Place and turn the joints."""


class _Bodies(_Group):
    """Rigid bodies, whose rotations are known beforehand."""

    def turn(self, rows: _Rows) -> None:
        self.place(rows)


class _Ends(_Group):
    """Joints without children, which do not turn."""

    def turn(self, rows: _Rows) -> None:
        rows.world[:, self.joints] = self.place(rows)


class _Swings(_Group):
    """Joints that turn the shortest way from the parent until a bone aims at the child."""

    def __init__(self, solver: FrameSolver, joints: Sequence[int], children: Sequence[int]) -> None:
        super().__init__(solver, joints)
        self.children = np.array(children)  # (G,)
        self.bones = normalize(solver.offsets[None, self.children])  # (1, G, 3)
        limbs = {limb.hinge: limb for limb in solver.limbs}
        self.bent = None  # (1, G, 4), or none where no joint is a hinge
        if any(j in limbs for j in joints):
            axes = [_hinge_axis(solver, limbs[j]) if j in limbs else np.array([1.0, 0.0, 0.0]) for j in joints]
            angles = np.array([[HALF_BENT if j in limbs else 0.0 for j in joints]])
            self.bent = _turn(np.array(axes)[None], angles)

    def turn(self, rows: _Rows) -> None:
        before = self.place(rows)
        if self.bent is not None:
            before = multiply(before, self.bent)
        aim = rows.target.take(self.children, 1) - rows.places.take(self.joints, 1)
        rows.world[:, self.joints] = aimed(before, self.bones, aim)


class _Twists(_Group):
    """Joints from below one rigid body up to the next; they swing and share the twist between the two."""

    def __init__(self, solver: FrameSolver, spine: int) -> None:
        *joints, self.body = chain = solver.spines[spine]
        super().__init__(solver, joints)
        self.spine = spine
        self.axes = normalize(solver.offsets[None, chain[1:]])  # (1, G, 3)
        self.shares = np.arange(1, len(chain)) / len(chain)  # (G,)

    def turn(self, rows: _Rows) -> None:
        swung = rows.world.take(self.joints, 1)
        rest = multiply(conjugate(swung[:, -1]), rows.world[:, self.body])
        twist = rows.moments.twist(self.spine, 2 * np.arctan2(dot(rest[:, 1:], self.axes[:, -1]), rest[:, 0]))
        rows.world[:, self.joints] = multiply(swung, _turn(self.axes, twist[:, None] * self.shares))


class _Limbs(_Group):
    """Upper arms and thighs: aimed at the hinge, and turned so that the hinge bends in its plane."""

    def __init__(self, solver: FrameSolver, numbers: Sequence[int]) -> None:
        limbs = [solver.limbs[number] for number in numbers]
        super().__init__(solver, [limb.upper for limb in limbs])
        self.numbers = numbers
        self.hinges = np.array([limb.hinge for limb in limbs])  # (G,)
        self.ends = np.array([limb.end for limb in limbs])  # (G,)
        self.one_way = np.array([limb.one_way for limb in limbs])  # (G,)
        self.bones = normalize(solver.offsets[None, self.hinges])  # (1, G, 3), as all that follow
        self.neutral = normalize(np.array([[limb.neutral for limb in limbs]]))
        self.to_neutral = between(self.bones, self.neutral)  # (1, G, 4)
        self.axes = np.array([[_hinge_axis(solver, limb) for limb in limbs]])  # perpendicular to the bones

    def turn(self, rows: _Rows) -> None:
        before = self.place(rows)
        hinges = rows.target.take(self.hinges, 1)
        upper = normalize(hinges - rows.places.take(self.joints, 1))
        lower = normalize(rows.target.take(self.ends, 1) - hinges)
        swing = multiply(aimed(before, self.neutral, upper), self.to_neutral)
        across = rotate(swing, self.axes)  # expected hinge axis, perpendicular to `upper`
        axis = cross(upper, lower)  # observed hinge axis, its length is the sine of the bend
        seen = _evidence(dot(axis, across), dot(axis, cross(upper, across)), self.one_way)
        twist = [rows.moments.bend(number, seen[:, k]) for k, number in enumerate(self.numbers)]
        rows.world[:, self.joints] = multiply(swing, _turn(self.bones, np.array(twist).T))


def _hinge_axis(solver: FrameSolver, limb: HingeLimb) -> Array:
    """Return the axis (3,) about which a hinge bends in the T-pose, perpendicular to the bone above it."""
    bone, normal = normalize(solver.offsets[limb.hinge]), np.array(limb.normal)
    return normalize(normal - bone * dot(bone, normal))


def _evidence(along: Array, beside: Array, one_way: NDArray[np.bool_]) -> Array:
    """Return the input (T, G, 2) of `Moments.bend`, from cosine and sine of the twist, both times the sine of the bend.

    Args:
        along, beside: (T, G). one_way: (G,).
    """
    squared = along * along + beside * beside
    weight = np.where(one_way & (along <= 0), 0.0, squared / (squared + BEND_SEEN**2))
    sine = np.sqrt(np.maximum(squared, 1e-18))
    seen = np.empty((*squared.shape, 2))
    seen[..., 0], seen[..., 1] = weight * along / sine, weight * beside / sine
    return seen


def _turn(axes: Array, angles: Array) -> Array:
    """Return rotations (T, G, 4) about unit axes (1, G, 3) by angles (T, G)."""
    half = angles / 2
    q = np.empty((*half.shape, 4))
    q[..., 0], q[..., 1:] = np.cos(half), np.sin(half)[..., None] * axes
    return q


@lru_cache(maxsize=64)
def _limbs(parents: tuple[int, ...], facing: tuple[int, ...]) -> tuple[HingeLimb, ...]:
    """Return arms and legs of a skeleton with known hips and shoulders.

    Normals in the T-pose: a knee bends about +X; an elbow takes the hand forward, about Y, the two sides opposite.
    """
    limbs: list[HingeLimb] = []
    for upper, arm, side in zip(facing, (False, False, True, True), (-1, 1, -1, 1), strict=False):
        hinges = [j for j, p in enumerate(parents) if p == upper]
        ends = [j for j, p in enumerate(parents) if hinges and p == hinges[0]]
        if len(hinges) == 1 and len(ends) == 1:
            x, y, z = NEUTRAL_ARM if arm else NEUTRAL_LEG
            normal = (0.0, -1.0 * side, 0.0) if arm else (1.0, 0.0, 0.0)
            limbs.append(HingeLimb(upper, hinges[0], ends[0], normal, (side * x, y, z), one_way=not arm))
    return tuple(limbs)


@lru_cache(maxsize=64)
def _spines(parents: tuple[int, ...], bodies: frozenset[int]) -> dict[int, tuple[int, ...]]:
    """Return chains between two rigid bodies by their first joint: (first, …, last, body above)."""
    chains: dict[int, tuple[int, ...]] = {}
    for body in bodies:
        chain = [body]
        while parents[chain[0]] >= 0 and parents[chain[0]] not in bodies:
            chain.insert(0, parents[chain[0]])
        if len(chain) > 1 and parents[chain[0]] >= 0:
            chains[chain[0]] = tuple(chain)
    return chains
