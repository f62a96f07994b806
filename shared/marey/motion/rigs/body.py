"""A rig with its parts, and its rest pose turned upright."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from itertools import permutations, product

import numpy as np

from marey.core.errors import InvalidInput
from marey.motion.rigs.joint_map import JointMap, map_joints
from marey.motion.rigs.parts import SIDES
from marey.motion.rigs.rig import Rig
from marey.motion.rigs.tree import hangs_on
from marey.motion.rotations import Array, angle_between, from_matrix, normalize, rotate

SNAP = np.radians(20.0)
"""Angle between a body and the axes of its file, up to which the axes are right: a trunk may lean at rest."""
LEGS_DOWN, TRUNK_UP, KNEES = np.cos(np.radians([40.0, 30.0, 40.0]))
"""Cosines of the largest angles in a standing rest pose: of legs and trunk from the vertical, and of the knees."""
FLOOR_BAND = (-0.02, 0.12)
"""Height of the lowest joint of the feet as a share of the leg, within which the floor of a rest pose is y = 0."""
SHORTEST, TALLEST = 0.2, 20.0
"""Metres from the feet to the hips of a body that can be meant; others have the wrong unit."""


@dataclass(frozen=True, eq=False)
class RigBody:
    """A rig with its parts.

    Attributes:
        rig: the rig.
        map: its parts.
        upright: (4,) turns the rest pose so that the trunk points up and the body faces +Z.
    """

    rig: Rig
    map: JointMap
    upright: Array = field(repr=False)

    @classmethod
    def of(cls, rig: Rig, joint_map: JointMap | None = None, *, sized: bool = True) -> RigBody:
        """Return the body of a rig.

        Args:
            rig: the rig.
            joint_map: its parts; None = find them.
            sized: check the size.

        Raises:
            InvalidInput: the rig has no legs, or a size that no character has.
        """
        joint_map = map_joints(rig) if joint_map is None else joint_map
        body = cls(rig, joint_map, _upright(rig, joint_map))
        if sized and not SHORTEST <= body.leg <= TALLEST:
            raise InvalidInput(
                f"its legs are {body.leg:.3g} m long: the unit of the file is wrong",
                where=rig.name,
                hint="Scale the character to its true size, apply the scale, and export it again.",
            )
        return body

    def has(self, part: str) -> bool:
        """Return True if the rig has a part."""
        return part in self.map.parts

    def at(self, part: str) -> Array:
        """Return the place (3,) of a part in the upright rest pose, metres."""
        return self.places[self.map.parts[part]]

    @cached_property
    def places(self) -> Array:
        """(J, 3) the upright rest pose, metres."""
        return rotate(self.upright, self.rig.positions)

    @cached_property
    def leg(self) -> float:
        """Mean length from hip over knee to ankle, metres."""
        chains = [
            [self.rig.positions[self.map.parts[f"{side}_{part}"]] for part in ("upper_leg", "lower_leg", "foot")]
            for side in SIDES
        ]
        return float(np.mean([np.linalg.norm(b - a) + np.linalg.norm(c - b) for a, b, c in chains]))

    @cached_property
    def standing(self) -> bool:
        """True if the rest pose stands: what is not aligned by directions can be trusted as it is."""
        up = np.array([0.0, 1.0, 0.0])
        trunk = normalize(self.top - self.hips) @ up > TRUNK_UP
        for side in SIDES:
            hip, knee, ankle = (self.at(f"{side}_{part}") for part in ("upper_leg", "lower_leg", "foot"))
            down = normalize(ankle - hip) @ -up > LEGS_DOWN
            trunk = trunk and down and normalize(knee - hip) @ normalize(ankle - knee) > KNEES
        return bool(trunk)

    @cached_property
    def hips(self) -> Array:
        """(3,) the middle between the hip joints in the upright rest pose, metres."""
        return (self.at("left_upper_leg") + self.at("right_upper_leg")) / 2

    @cached_property
    def top(self) -> Array:
        """(3,) the upper end of the spine in the upright rest pose, metres."""
        return _top(self.places, self.map)

    @cached_property
    def floor(self) -> float:
        """Height of the floor in the upright rest pose, metres: y = 0 where the feet are near it, else below them."""
        feet = [self.map.parts[f"{side}_foot"] for side in SIDES]
        rig = self.rig
        below = [j for j in range(len(rig)) if any(j == foot or hangs_on(rig.parents, j, foot) for foot in feet)]
        tips = rotate(self.upright, rig.positions[below] + rotate(rig.orientations[below], rig.tips[below]))
        lowest = float(np.nanmin(np.concatenate([self.places[below, 1], tips[:, 1]])))
        low, high = FLOOR_BAND
        return 0.0 if low * self.leg <= lowest <= high * self.leg else lowest


def _top(places: Array, joint_map: JointMap) -> Array:
    """Return the beginning of the neck, or what stands for it: the middle of the shoulders, the head."""
    parts = joint_map.parts
    for names in (("neck1",), ("left_upper_arm", "right_upper_arm"), ("head",), ("spine1",)):
        if all(name in parts for name in names):
            place = places[[parts[name] for name in names]].mean(axis=0)
            if np.linalg.norm(place - places[parts["hips"]]) > 1e-6:
                return place
    return places[parts["hips"]] + np.array([0.0, 1.0, 0.0])


def _upright(rig: Rig, joint_map: JointMap) -> Array:
    """Return the rotation (4,) from the rest pose to a body along Y that faces +Z; along the file's axes if it is near
    them."""
    left_hip, right_hip = (rig.positions[joint_map.parts[f"{side}_upper_leg"]] for side in SIDES)
    up = _top(rig.positions, joint_map) - (left_hip + right_hip) / 2
    axes = frame(up, left_hip - right_hip)
    turn = from_matrix(axes.T)
    square = _right_angles()
    angles = angle_between(square, turn[None])
    nearest = int(np.argmin(angles))
    return square[nearest] if angles[nearest] < SNAP else turn


def frame(up: Array, left: Array) -> Array:
    """Return a rotation matrix (3, 3) with columns left, up and forward; `up` is kept."""
    up = normalize(up)
    forward = normalize(np.cross(left, up))
    return np.stack([np.cross(up, forward), up, forward], axis=-1)


def _right_angles() -> Array:
    """Return the 24 rotations (24, 4) that take axes to axes, the one that turns nothing first."""
    found = [np.eye(3)]
    for order, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3)):
        matrix = np.eye(3)[list(order)] * np.array(signs)[:, None]
        if np.linalg.det(matrix) > 0:
            found.append(matrix)
    return from_matrix(np.array(found))
