"""The joints of a rig by the turns of its parts, and its local poses."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from marey.motion.retarget.align import IDENTITY
from marey.motion.retarget.helpers import share_twists
from marey.motion.retarget.legs import UP
from marey.motion.retarget.source import Source
from marey.motion.rigs.body import RigBody
from marey.motion.rigs.rig import Rig
from marey.motion.rigs.rigged import RiggedMotion
from marey.motion.rotations import Array, between, conjugate, multiply, rotate

MOVES = 1e-6
"""Metres by which a joint's translation must differ from the rest pose, to be written."""


class PosedRig:
    """The joints of a target by the turns of its parts.

    Args:
        target: the rig with its parts.
        turns: (T, 4) of each part from the upright rest pose, in the world.
        place: (T, 3) where the hips are, metres.
    """

    def __init__(self, target: RigBody, turns: dict[str, Array], place: Array) -> None:
        self.target, self.place = target, place
        self.turns = {part: turn for part, turn in turns.items() if target.has(part)}
        self._free = _free(target, self.turns)
        self._posed = _with_parents(target, self._free)

    def spread(self) -> tuple[Array, Array]:
        """Return turns from the upright rest pose (T, J, 4) and places (T, J, 3) of the joints that turn by themselves
        and of all over them; those above the hips keep their rest pose. Others, such as fingers, are not set."""
        rig, parts = self.target.rig, self.target.map.parts
        frames = len(self.place)
        turned, places = np.empty((frames, len(rig), 4)), np.empty((frames, len(rig), 3))
        by_joint = {parts[part]: turn for part, turn in self.turns.items()}
        hips, rest = parts["hips"], self.target.places
        for joint in self._posed:
            parent = rig.parents[joint]
            if joint in by_joint:
                turned[:, joint] = by_joint[joint]
            else:
                turned[:, joint] = conjugate(self.target.upright) if parent < 0 else turned[:, parent]
            if joint == hips:
                places[:, joint] = self.place
            elif parent < 0:
                places[:, joint] = rig.positions[joint]
            else:
                places[:, joint] = places[:, parent] + rotate(turned[:, parent], rest[joint] - rest[parent])
        return turned, places

    def motion(self, source: Source) -> RiggedMotion:
        """Return the motion in local poses of the rig, with helpers, facing as the rig's rest pose faces."""
        target, rig = self.target, self.target.rig
        turned, places = self.spread()
        share_twists(target, turned)
        for joint, part in target.map.follows.items():
            leader = target.map.parts[part]
            turned[:, joint] = turned[:, leader]
            away = target.places[joint] - target.places[leader]
            places[:, joint] = places[:, leader] + rotate(turned[:, leader], away)
        fixed = [joint for joint in range(len(rig)) if _over(target, joint)]
        face, posed = _facing(target.upright), self._posed
        rest = multiply(target.upright, rig.orientations[posed])
        turned[:, posed] = multiply(face, multiply(turned[:, posed], rest))
        places[:, posed] = rotate(face, places[:, posed])
        turned[:, fixed], places[:, fixed] = rig.orientations[fixed], rig.positions[fixed]
        return _local(source, target, turned, places, self._free)


def _free(target: RigBody, turns: Mapping[str, Array]) -> list[int]:
    """Return the joints that turn or move against their parent, parents before children."""
    parts, joint_map = target.map.parts, target.map
    own = {parts["hips"], *(parts[part] for part in turns), *joint_map.twists, *joint_map.follows}
    own |= {joint for joint, parent in enumerate(target.rig.parents) if parent in joint_map.twists}
    own |= {joint for joint in range(len(target.rig)) if _over(target, joint)}
    return sorted(own)


def _with_parents(target: RigBody, joints: Iterable[int]) -> list[int]:
    """Return joints with all that they hang on, parents before children."""
    found: set[int] = set()
    for joint in joints:
        while joint >= 0 and joint not in found:
            found.add(joint)
            joint = target.rig.parents[joint]
    return sorted(found)


def _over(target: RigBody, joint: int) -> bool:
    """Return True if a joint neither moves nor hangs on one that does: it is over the hips or beside them."""
    moving = {target.map.parts["hips"], *target.map.follows}
    while joint >= 0:
        if joint in moving:
            return False
        joint = target.rig.parents[joint]
    return True


def _local(source: Source, target: RigBody, world: Array, places: Array, joints: list[int]) -> RiggedMotion:
    rig = target.rig
    rotations, translations, moving = local_poses(rig, world, places, joints)
    about = {"name": rig.name, "sha256": rig.sha256, "family": target.map.family}
    manifest = {**source.manifest, "rig": about}
    hips = target.map.parts["hips"]
    return RiggedMotion(rig, rotations, translations, moving, source.contacts, source.fps, hips, manifest)


def local_poses(
    rig: Rig, world: Array, places: Array, joints: Sequence[int] | None = None
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Return local rotations (T, J, 4), translations (T, J, 3) and which joints move (J,), see `RiggedMotion`, of
    orientations (T, J, 4) and places (T, J, 3) in the world.

    Args:
        joints: those that turn or move against their parent; of all others, orientations and places are not read and
            the rest pose stays. None = all joints.
    """
    own = list(range(len(rig)) if joints is None else joints)
    rotations = np.tile(rig.local_rotations, (len(world), 1, 1))
    translations = np.tile(rig.offsets, (len(world), 1, 1))
    roots, inner = [j for j in own if rig.parents[j] < 0], [j for j in own if rig.parents[j] >= 0]
    rotations[:, roots], translations[:, roots] = world[:, roots], places[:, roots]
    over = [rig.parents[joint] for joint in inner]
    back = conjugate(world[:, over])
    rotations[:, inner] = multiply(back, world[:, inner])
    translations[:, inner] = rotate(back, places[:, inner] - places[:, over])
    moving = np.abs(translations - rig.offsets).max(axis=(0, 2)) > MOVES
    translations[:, ~moving] = rig.offsets[~moving]
    return rotations, translations, moving


def _facing(upright: Array) -> Array:
    """Return the turn (4,) about the vertical from +Z to where a rest pose faces; none if it does not stand upright."""
    if rotate(upright, UP) @ UP < 0.99:
        return IDENTITY
    ahead = rotate(conjugate(upright), np.array([0.0, 0.0, 1.0]))
    return between(np.array([0.0, 0.0, 1.0]), ahead * np.array([1.0, 0.0, 1.0]))
