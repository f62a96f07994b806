"""The drawn body: round cones along the bones of a skeleton, for contact sheets and the player.

Any skeleton gets a body: legs end in feet, arms in hands, and the highest bone of the trunk carries a head with a nose,
so that a picture shows which way a person faces. Sizes and directions are measured in a pose in which the body stands:
the T-pose of Marey's skeletons; for a foreign skeleton, whose rest pose may be anything, the frame in which it is
tallest.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from marey.motion.clip import MotionClip
from marey.motion.kinematics import global_rotations
from marey.motion.rotations import to_matrix
from marey.motion.skeleton import Skeleton

Part = Literal["left", "right", "middle", "face"]
Vector = tuple[float, float, float]
NOWHERE: Vector = (0.0, 0.0, 0.0)

# Radii in metres on a body whose joints span 1.5 m from the lowest to the highest; they scale with the span.
SPAN = 1.5
PELVIS, WAIST, CHEST, NECK, GIRDLE = 0.098, 0.094, 0.108, 0.048, 0.062
DETAIL = 0.015  # eyes and similar joints: side branches of the trunk shorter than an arm
SHORTEST_LIMB = 0.3
SOLE = 0.028
# Radius over the share of the way from where the limb leaves the trunk to its end.
LEG = ((0.0, 0.45, 0.85, 1.0), (0.084, 0.058, 0.041, SOLE))
ARM = ((0.0, 0.17, 0.60, 1.0), (0.062, 0.056, 0.042, 0.030))
END_SITE = re.compile(r"(end|nub|top|site|tip)$", re.IGNORECASE)


@dataclass(frozen=True)
class LimbShape:
    """A round cone between two points, each fixed to a joint by an offset in that joint's own axes, metres."""

    part: Part
    start: int
    end: int
    start_radius: float
    end_radius: float
    start_offset: Vector = NOWHERE
    end_offset: Vector = NOWHERE


@dataclass(frozen=True)
class BodyShape:
    """The limbs of one skeleton; the height of the standing figure, and the depth of its soles below the lowest
    joint."""

    limbs: tuple[LimbShape, ...]
    height: float  # metres
    sole: float  # metres

    def points(self, joints: NDArray[np.floating], axes: NDArray[np.floating]) -> NDArray[np.float32]:
        """Return the ends of every limb in the world.

        Args:
            joints: (F, J, 3) world positions, metres.
            axes: (F, J, 3, 3) world rotation matrices of the joints.

        Returns:
            (F, L, 2, 3) metres.
        """
        ends = np.array([(limb.start, limb.end) for limb in self.limbs])
        offsets = np.array([(limb.start_offset, limb.end_offset) for limb in self.limbs])
        return (joints[:, ends] + np.einsum("flkij,lkj->flki", axes[:, ends], offsets)).astype(np.float32)

    def radii(self) -> NDArray[np.float32]:
        """Return radii (L, 2) in metres."""
        return np.array([(limb.start_radius, limb.end_radius) for limb in self.limbs], np.float32)


def dress(skeleton: Skeleton) -> BodyShape:
    """Build the body of a skeleton that stands in its rest pose, facing +Z."""
    return _BodyBuilder(skeleton, skeleton.rest, np.broadcast_to(np.eye(3), (len(skeleton), 3, 3))).body()


def dress_clip(clip: MotionClip) -> BodyShape:
    """Build the body of a clip's skeleton, whatever its rest pose is."""
    if clip.skeleton.facing:
        return dress(clip.skeleton)
    tallest = int(np.argmax(_stature(clip.skeleton, clip.joints)))
    axes = to_matrix(global_rotations(clip.skeleton, clip.rotations[tallest : tallest + 1]))[0]
    return _BodyBuilder(clip.skeleton, clip.joints[tallest], axes).body()


def part_of(skeleton: Skeleton, joint: int) -> Part:
    """Return the side of a joint: where its name first differs from its mirror image's, one has an L and one an R."""
    name, twin = skeleton.joint_names[joint].lower(), skeleton.joint_names[skeleton.mirror[joint]].lower()
    difference = next(((a, b) for a, b in zip(name, twin, strict=False) if a != b), None)
    if difference is None:
        return "middle"
    return "left" if difference[0] == "l" else "right"


def forward_of(skeleton: Skeleton, places: NDArray[np.floating]) -> NDArray[np.float64]:
    """Return the forward direction of a body: on the floor, perpendicular to the line from right to left hips and
    collars.

    Args:
        skeleton: its sides are read from its joints' names.
        places: (..., J, 3) world positions.

    Returns:
        (..., 3) unit vectors; +Z for a body without sides.
    """
    part = [part_of(skeleton, j) for j in range(len(skeleton))]
    left = [j for j, p in enumerate(skeleton.parents) if part[j] == "left" and p >= 0 and part[p] == "middle"]
    right = [skeleton.mirror[j] for j in left]
    across = places[..., left, :].sum(axis=-2) - places[..., right, :].sum(axis=-2)
    forward = np.stack([-across[..., 2], 0 * across[..., 0], across[..., 0]], axis=-1).astype(np.float64)
    length = np.linalg.norm(forward, axis=-1, keepdims=True)
    return np.where(length > 1e-6, forward / np.maximum(length, 1e-6), [0.0, 0.0, 1.0])


def _stature(skeleton: Skeleton, places: NDArray[np.floating]) -> NDArray[np.floating]:
    """Return the height (...) from the lowest joint of (..., J, 3) to the highest of the middle: raised hands do not
    count."""
    middle = [j for j in range(len(skeleton)) if skeleton.mirror[j] == j]
    return places[..., middle, 1].max(axis=-1) - places[..., 1].min(axis=-1)


class _BodyBuilder:
    """Measurement of one skeleton in a standing pose: places (J, 3) and axes (J, 3, 3) of its joints."""

    def __init__(self, skeleton: Skeleton, places: NDArray[np.floating], axes: NDArray[np.floating]) -> None:
        self.skeleton, self.places, self.axes = skeleton, places.astype(np.float64), axes
        count = len(skeleton)
        self.height = max(float(_stature(skeleton, self.places)), 1e-3)
        self.unit = self.height / SPAN
        self.part: list[Part] = [part_of(skeleton, j) for j in range(count)]
        self.forward = forward_of(skeleton, self.places)
        # How far down its limb a joint lies, and how long the longest branch of the limb is, metres.
        self.top, self.reach, self.longest = list(range(count)), [0.0] * count, [0.0] * count
        for j in range(1, count):
            parent = skeleton.parents[j]
            if self.part[j] != "middle" and self.part[parent] != "middle":
                self.top[j], self.reach[j] = self.top[parent], self.reach[parent] + self.length(j)
                self.longest[self.top[j]] = max(self.longest[self.top[j]], self.reach[j])
        self.legs = {self.top[j] for j in range(count) if self._is_leg(j)}
        self.trunk: set[int] = set()
        for j in range(1, count):
            if self.top[j] == j and self.part[j] != "middle" and not self._is_detail(j):
                self.trunk.update(self._ancestors(j))

    def body(self) -> BodyShape:
        limbs = [self.bone(j) for j in range(1, len(self.skeleton)) if self.length(j) > 1e-4]
        limbs += [*self.head(), *self.hands(), *self.feet()]
        return BodyShape(tuple(limbs), height=self.height + 0.2 * self.unit, sole=SOLE * self.unit)

    def _fixed_to(self, joint: int, vector: NDArray[np.floating]) -> Vector:
        """Return a world vector of the standing pose in the joint's own axes."""
        x, y, z = (float(v) for v in self.axes[joint].T @ vector)
        return x, y, z

    def length(self, joint: int) -> float:
        return float(np.linalg.norm(self.skeleton.offsets[joint]))

    def _ancestors(self, joint: int) -> list[int]:
        found: list[int] = []
        while (joint := self.skeleton.parents[joint]) >= 0:
            found.append(joint)
        return found

    def _is_leg(self, joint: int) -> bool:
        if self.skeleton.feet:
            return joint in self.skeleton.feet
        low = self.places[:, 1].min() + 0.15 * SPAN * self.unit
        return self.part[joint] != "middle" and bool(self.places[joint, 1] < low)

    def _is_detail(self, joint: int) -> bool:
        limb = self.top[joint]
        return limb not in self.legs and self.longest[limb] < SHORTEST_LIMB * self.unit

    def radius(self, joint: int) -> float:
        if self.part[joint] != "middle":
            limb = self.top[joint]
            if self._is_detail(joint):
                return self.unit * DETAIL
            share = self.reach[joint] / self.longest[limb] if self.longest[limb] else 0.0
            return self.unit * float(np.interp(share, *(LEG if limb in self.legs else ARM)))
        if joint == 0:
            return self.unit * PELVIS
        if joint not in self.trunk:
            return self.unit * NECK
        shoulders = [c for c in self.skeleton.children[joint] if self.part[c] != "middle" and not self._is_detail(c)]
        return self.unit * (CHEST if shoulders else WAIST)

    def bone(self, joint: int) -> LimbShape:
        parent = self.skeleton.parents[joint]
        end = self.radius(joint)
        start = self.radius(parent)
        if self.part[parent] == "middle" and self.part[joint] != "middle":  # where a limb leaves the trunk
            start = end if self._is_detail(joint) else self.unit * (0.9 * PELVIS if joint in self.legs else GIRDLE)
            # A little thinner than the limb that begins there, so that two surfaces never coincide and flicker.
            return LimbShape("middle", parent, joint, start, 0.95 * end)
        if parent in self.trunk and joint not in self.trunk:  # the chest narrows towards the neck
            start = 0.92 * self.unit * CHEST
        return LimbShape(self.part[joint], parent, joint, start, end)

    def head(self) -> list[LimbShape]:
        """Return a skull and a nose on the highest bone of the middle."""
        inner = {self.skeleton.parents[j] for j, part in enumerate(self.part) if part == "middle"}
        leaves = [j for j, part in enumerate(self.part) if part == "middle" and j and j not in inner]
        if not leaves:
            return []
        joint = max(leaves, key=lambda j: self.places[j, 1])
        if END_SITE.search(self.skeleton.joint_names[joint]):
            joint = self.skeleton.parents[joint]

        def at(up: float, forward: float) -> Vector:
            return self._fixed_to(joint, self.unit * (np.array([0.0, up, 0.0]) + forward * self.forward))

        skull = LimbShape(
            "middle", joint, joint, 0.070 * self.unit, 0.088 * self.unit, at(0.030, 0.020), at(0.105, 0.012)
        )
        nose = LimbShape("face", joint, joint, 0.012 * self.unit, 0.019 * self.unit, at(0.085, 0.098), at(0.048, 0.102))
        return [skull, nose]

    def hands(self) -> list[LimbShape]:
        """Return a hand beyond the wrist, if the skeleton ends there."""
        hands: list[LimbShape] = []
        for joint, children in enumerate(self.skeleton.children):
            top = self.top[joint]
            alone = sum(self.top[j] == top and not c for j, c in enumerate(self.skeleton.children)) == 1
            if children or self.part[joint] == "middle" or top in self.legs or not alone or self._is_detail(joint):
                continue
            bone = self.places[joint] - self.places[self.skeleton.parents[joint]]
            tip = self._fixed_to(joint, bone / max(self.length(joint), 1e-6) * 0.135 * self.unit)
            hands.append(
                LimbShape(self.part[joint], joint, joint, 0.036 * self.unit, 0.021 * self.unit, end_offset=tip)
            )
        return hands

    def feet(self) -> list[LimbShape]:
        """Return heel and toes, which show where a foot stands and points."""
        feet: list[LimbShape] = []
        for ankle, toe in zip(self.skeleton.feet[::2], self.skeleton.feet[1::2], strict=True):
            drop = self.places[toe, 1] - self.places[ankle, 1]
            heel = self._fixed_to(ankle, np.array([0.0, drop, 0.0]) - 0.040 * self.unit * self.forward)
            tip = self._fixed_to(toe, 0.055 * self.unit * self.forward)
            wide, thin = 0.033 * self.unit, SOLE * self.unit
            feet.append(LimbShape(self.part[toe], ankle, toe, thin, wide, start_offset=heel))
            feet.append(LimbShape(self.part[toe], toe, toe, wide, 0.75 * thin, end_offset=tip))
        return feet
