"""Joints of the body in a skeleton of a BVH file: the ends of the limbs by their names, the others by the tree."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from marey.core.errors import InvalidFile
from marey.motion.io.bvh import BvhClip
from marey.motion.rotations import rotate

Array = NDArray[np.floating]
_SIDES = {"l": "left", "left": "left", "r": "right", "right": "right"}
_HELPERS = ("twist", "roll", "helper", "ik", "pole", "ctrl", "muscle")
_ANKLES = ("foot", "ankle")
_WRISTS = ("hand", "wrist", "palm")
_TOES = ("toe", "toes", "toebase", "ball", "toe0", "midfoot")
_LIMB_NAMES = """femur tibia foot toes thigh shin calf upleg leg hip knee ankle toe ball clavicle collar shoulder shldr
humerus arm uparm upperarm forearm lowerarm elbow radius wrist hand palm"""
_LIMB_PARTS = frozenset(_LIMB_NAMES.split())


@dataclass(frozen=True)
class BodyJoints:
    """Joints of the body in a skeleton, as indices; toes may be End Sites."""

    clip: BvhClip
    trunk: Sequence[int]
    legs: Sequence[Sequence[int]]  # hip, knee, ankle, toe (-1: the End Site of the ankle)
    arms: Sequence[Sequence[int]]

    @classmethod
    def of(cls, clip: BvhClip) -> BodyJoints:
        """Recognise the joints.

        Raises:
            InvalidFile: a part of the body is missing.
        """
        joints = _Joints(clip)
        legs = [joints.limb(side, _ANKLES, "ankle") for side in ("left", "right")]
        arms = [joints.limb(side, _WRISTS, "wrist") for side in ("left", "right")]
        pelvis, chest = joints.common(legs[0][0], legs[1][0]), joints.common(arms[0][0], arms[1][0])
        path = joints.path(pelvis, chest)
        spine = path[0] if path else chest
        middle = path[-2] if len(path) > 1 else spine
        head = joints.head(chest)
        above = joints.path(chest, head)
        neck = above[0] if above else head
        return cls(
            clip,
            (pelvis, spine, middle, chest, neck, head),
            [(*leg, joints.toe(leg[2])) for leg in legs],
            [(joints.clavicle(arm[0], chest), *arm) for arm in arms],
        )

    def name(self, joint: int) -> str:
        """Return the name of a joint."""
        return self.clip.skeleton.joint_names[joint]

    def toe(self, leg: Sequence[int]) -> str:
        """Return the name of the toe of a leg, as `dataset.toml` has it."""
        return self.name(leg[3]) if leg[3] >= 0 else f"{self.name(leg[2])}:end"

    def toe_rest(self, leg: Sequence[int]) -> Array:
        """Return the toe (3,) of the rest pose."""
        rest = self.clip.skeleton.rest
        return rest[leg[3]] if leg[3] >= 0 else rest[leg[2]] + self.clip.ends[leg[2]]

    def toe_places(self, leg: Sequence[int], places: Array, world: Array, clip: BvhClip) -> Array:
        """Return the toe (T, 3) in the world."""
        if leg[3] >= 0:
            return places[:, leg[3]]
        return places[:, leg[2]] + rotate(world[:, leg[2]], clip.ends[leg[2]])


class _Joints:
    """Names and parents of a skeleton."""

    def __init__(self, clip: BvhClip) -> None:
        skeleton = clip.skeleton
        self._names, self._parents, self._ends = skeleton.joint_names, skeleton.parents, clip.ends
        self._rest = skeleton.rest
        self._read = [_side_and_part(name) for name in self._names]

    def limb(self, side: str, ends: Sequence[str], what: str) -> tuple[int, int, int]:
        """Return the two joints above the end of a limb, and the end: hip, knee, ankle, or shoulder, elbow, wrist."""
        found = [joint for joint, (its, part) in enumerate(self._read) if its == side and part in ends]
        for joint in sorted(found, key=lambda joint: len(self._above(joint))):
            chain = [above for above in self._above(joint) if not self._is_helper(above)]
            if len(chain) >= 2:
                return chain[1], chain[0], joint
        raise InvalidFile(f"no {side} {what} is recognised by its name")

    def common(self, one: int, other: int) -> int:
        """Return the lowest joint above both."""
        above = {one, *self._above(one)}
        for joint in (other, *self._above(other)):
            if joint in above and joint not in (one, other):
                return joint
        raise InvalidFile(f"{self._names[one]!r} and {self._names[other]!r} have no joint above both")

    def path(self, top: int, bottom: int) -> list[int]:
        """Return the joints below `top` down to `bottom`, or below the lowest joint above both; helpers are left
        out."""
        chain = [bottom, *self._above(bottom)]
        known = {top, *self._above(top)}
        below = [joint for joint in chain if joint not in known]
        return [joint for joint in reversed(below) if not self._is_helper(joint)]

    def head(self, chest: int) -> int:
        """Return the head: by its name, else the end of the chain in the middle above the chest."""
        under = [joint for joint in range(len(self._names)) if chest in self._above(joint)]
        named = [joint for joint in under if self._read[joint] == ("", "head")]
        middle = [joint for joint in under if not self._read[joint][0]]
        if not named and not middle:
            raise InvalidFile("no head is recognised above the chest")
        return min(named, key=lambda joint: len(self._above(joint))) if named else middle[-1]

    def toe(self, ankle: int) -> int:
        """Return the toe, or -1 for the End Site of the ankle."""
        children = [joint for joint, parent in enumerate(self._parents) if parent == ankle]
        named = [joint for joint in children if self._read[joint][1].rstrip("0123456789") in _TOES]
        if named or (children and np.isnan(self._ends[ankle]).any()):
            return (named or children)[0]
        if np.isnan(self._ends[ankle]).any():
            raise InvalidFile(f"{self._names[ankle]!r} has neither a toe nor an End Site")
        return -1

    def clavicle(self, shoulder: int, chest: int) -> int:
        """Return the joint between chest and shoulder, or the chest if there is none."""
        between = self.path(chest, shoulder)[:-1]
        return between[-1] if between else chest

    def _above(self, joint: int) -> list[int]:
        found: list[int] = []
        while (joint := self._parents[joint]) >= 0:
            found.append(joint)
        return found

    def _is_helper(self, joint: int) -> bool:
        return any(helper in self._names[joint].lower() for helper in _HELPERS)


def _side_and_part(name: str) -> tuple[str, str]:
    """Return the side (`left`, `right` or empty) and the part that a joint's name says: `mixamorig:LeftUpLeg` is
    ("left", "upleg")."""
    plain = re.split(r"[:|]", name)[-1]
    words = [word.lower() for word in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+", plain)]
    sides = [_SIDES[word] for word in words if word in _SIDES]
    rest = "".join(word for word in words if word not in _SIDES and word not in {"bip", "bip01", "jnt", "joint", "def"})
    if not sides and rest[:1] in ("l", "r") and rest[1:] in _LIMB_PARTS:
        return _SIDES[rest[0]], rest[1:]
    return (sides[0] if sides else ""), rest
