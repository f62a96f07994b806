"""The drawn body: a skeleton dressed in round cones, for the contact sheet and for the player alike.

Everything is measured from the skeleton's rest pose (T-pose, facing +Z, metres), so any skeleton gets a body: legs end
in feet, arms in hands, the highest bone of the middle carries a head with a nose, so that a picture shows which
way a person faces. Left is the side of +X in the rest pose.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from shared.motion.kinematics import facing
from shared.motion.skeleton import Skeleton

Part = Literal["left", "right", "middle", "face"]
Vector = tuple[float, float, float]
NOWHERE: Vector = (0.0, 0.0, 0.0)

# Radii in metres on a body whose joints span 1.5 m from the lowest to the highest; they scale with the span.
SPAN = 1.5
PELVIS, WAIST, CHEST, NECK, GIRDLE = 0.098, 0.094, 0.108, 0.048, 0.062
SOLE = 0.028
# Radius over the share of the way from where the limb leaves the trunk to its end.
LEG = ((0.0, 0.45, 0.85, 1.0), (0.084, 0.058, 0.041, SOLE))
ARM = ((0.0, 0.17, 0.60, 1.0), (0.062, 0.056, 0.042, 0.030))
END_SITE = re.compile(r"(end|nub|top|site|tip)$", re.IGNORECASE)


@dataclass(frozen=True)
class Limb:
    """A round cone between two points, each fixed to a joint by an offset in that joint's own axes, metres."""

    part: Part
    start: int
    end: int
    start_radius: float
    end_radius: float
    start_offset: Vector = NOWHERE
    end_offset: Vector = NOWHERE


@dataclass(frozen=True)
class Body:
    """The limbs of one skeleton; how high the figure stands, and how far its soles reach under the lowest joint."""

    limbs: tuple[Limb, ...]
    height: float  # metres
    sole: float  # metres

    def points(self, joints: NDArray[np.floating], axes: NDArray[np.floating]) -> NDArray[np.float32]:
        """Ends of every limb in the world.

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
        """(L, 2) metres."""
        return np.array([(limb.start_radius, limb.end_radius) for limb in self.limbs], np.float32)


def dress(skeleton: Skeleton) -> Body:
    """Put a body on a skeleton."""
    tailor = _Tailor(skeleton)
    limbs = [tailor.bone(j) for j in range(1, len(skeleton)) if tailor.length(j) > 1e-4]
    limbs += [*tailor.head(), *tailor.hands(), *tailor.feet()]
    return Body(tuple(limbs), height=float(np.ptp(tailor.rest[:, 1])) + 0.2 * tailor.unit, sole=SOLE * tailor.unit)


def part_of(skeleton: Skeleton, joint: int) -> Part:
    """The side a joint is on: where its name first differs from its mirror image's, one has an L and one an R."""
    name, twin = skeleton.joint_names[joint].lower(), skeleton.joint_names[skeleton.mirror[joint]].lower()
    difference = next(((a, b) for a, b in zip(name, twin, strict=False) if a != b), None)
    if difference is None:
        return "middle"
    return "left" if difference[0] == "l" else "right"


class _Tailor:
    """Measures one skeleton."""

    def __init__(self, skeleton: Skeleton) -> None:
        self.skeleton, self.rest = skeleton, skeleton.rest.astype(np.float64)
        count = len(skeleton)
        self.unit = max(float(np.ptp(self.rest[:, 1])), 1e-3) / SPAN
        self.forward = facing(self.rest, skeleton) if skeleton.facing else np.array([0.0, 0.0, 1.0])
        self.part: list[Part] = [part_of(skeleton, j) for j in range(count)]
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
            if self.part[j] != "middle" and self.part[skeleton.parents[j]] == "middle":
                self.trunk.update(self._ancestors(j))

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
        low = self.rest[:, 1].min() + 0.15 * SPAN * self.unit
        return self.part[joint] != "middle" and bool(self.rest[joint, 1] < low)

    def radius(self, joint: int) -> float:
        if self.part[joint] != "middle":
            limb = self.top[joint]
            share = self.reach[joint] / self.longest[limb] if self.longest[limb] else 0.0
            return self.unit * float(np.interp(share, *(LEG if limb in self.legs else ARM)))
        if joint == 0:
            return self.unit * PELVIS
        if joint not in self.trunk:
            return self.unit * NECK
        return self.unit * (CHEST if any(self.part[c] != "middle" for c in self.skeleton.children[joint]) else WAIST)

    def bone(self, joint: int) -> Limb:
        parent = self.skeleton.parents[joint]
        end = self.radius(joint)
        start = self.radius(parent)
        if self.part[parent] == "middle" and self.part[joint] != "middle":  # where a limb leaves the trunk
            start = self.unit * (0.9 * PELVIS if joint in self.legs else GIRDLE)
            # A little thinner than the limb that begins there, so that two surfaces never coincide and flicker.
            return Limb("middle", parent, joint, start, 0.95 * end)
        if parent in self.trunk and joint not in self.trunk:  # the chest narrows towards the neck
            start = 0.92 * self.unit * CHEST
        return Limb(self.part[joint], parent, joint, start, end)

    def head(self) -> list[Limb]:
        """A skull and a nose on the highest bone of the middle."""
        leaves = [j for j, c in enumerate(self.skeleton.children) if not c and self.part[j] == "middle" and j]
        if not leaves:
            return []
        joint = max(leaves, key=lambda j: self.rest[j, 1])
        if END_SITE.search(self.skeleton.joint_names[joint]):
            joint = self.skeleton.parents[joint]

        def at(up: float, forward: float) -> Vector:
            return _vector(self.unit * (np.array([0.0, up, 0.0]) + forward * self.forward))

        skull = Limb("middle", joint, joint, 0.070 * self.unit, 0.088 * self.unit, at(0.030, 0.020), at(0.105, 0.012))
        nose = Limb("face", joint, joint, 0.012 * self.unit, 0.019 * self.unit, at(0.085, 0.098), at(0.048, 0.102))
        return [skull, nose]

    def hands(self) -> list[Limb]:
        """A hand beyond the wrist, where the skeleton ends there."""
        hands: list[Limb] = []
        for joint, children in enumerate(self.skeleton.children):
            top = self.top[joint]
            alone = sum(self.top[j] == top and not c for j, c in enumerate(self.skeleton.children)) == 1
            if children or self.part[joint] == "middle" or top in self.legs or not alone or joint == top:
                continue
            offset = self.skeleton.offsets[joint].astype(np.float64)
            tip = _vector(offset / max(self.length(joint), 1e-6) * 0.135 * self.unit)
            hands.append(Limb(self.part[joint], joint, joint, 0.036 * self.unit, 0.021 * self.unit, end_offset=tip))
        return hands

    def feet(self) -> list[Limb]:
        """Heel and toes, so that a foot shows where it stands and points."""
        feet: list[Limb] = []
        for ankle, toe in zip(self.skeleton.feet[::2], self.skeleton.feet[1::2], strict=True):
            drop = self.rest[toe, 1] - self.rest[ankle, 1]
            heel = _vector(np.array([0.0, drop, 0.0]) - 0.040 * self.unit * self.forward)
            tip = _vector(0.055 * self.unit * self.forward)
            wide, thin = 0.033 * self.unit, SOLE * self.unit
            feet.append(Limb(self.part[toe], ankle, toe, thin, wide, start_offset=heel))
            feet.append(Limb(self.part[toe], toe, toe, wide, 0.75 * thin, end_offset=tip))
        return feet


def _vector(values: NDArray[np.floating]) -> Vector:
    x, y, z = (float(v) for v in values)
    return x, y, z
