"""The joints of a rig by the turns of its parts, and its local poses."""

from __future__ import annotations

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

    def spread(self) -> tuple[Array, Array]:
        """Return turns from the upright rest pose (T, J, 4) and places (T, J, 3) of all joints; those above the hips
        keep their rest pose."""
        rig, parts = self.target.rig, self.target.map.parts
        frames = len(self.place)
        turned, places = np.empty((frames, len(rig), 4)), np.empty((frames, len(rig), 3))
        by_joint = {parts[part]: turn for part, turn in self.turns.items()}
        hips, rest = parts["hips"], self.target.places
        for joint, parent in enumerate(rig.parents):
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
        face = _facing(target.upright)
        world = multiply(face, multiply(turned, multiply(target.upright, rig.orientations)))
        places = rotate(face, places)
        world[:, fixed], places[:, fixed] = rig.orientations[fixed], rig.positions[fixed]
        return _local(source, target, world, places)


def _over(target: RigBody, joint: int) -> bool:
    """Return True if a joint neither moves nor hangs on one that does: it is over the hips or beside them."""
    moving = {target.map.parts["hips"], *target.map.follows}
    while joint >= 0:
        if joint in moving:
            return False
        joint = target.rig.parents[joint]
    return True


def _local(source: Source, target: RigBody, world: Array, places: Array) -> RiggedMotion:
    rig = target.rig
    rotations, translations, moving = local_poses(rig, world, places)
    about = {"name": rig.name, "sha256": rig.sha256, "family": target.map.family}
    manifest = {**source.manifest, "rig": about}
    hips = target.map.parts["hips"]
    return RiggedMotion(rig, rotations, translations, moving, source.contacts, source.fps, hips, manifest)


def local_poses(rig: Rig, world: Array, places: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Return local rotations (T, J, 4), translations (T, J, 3) and which joints move (J,), see `RiggedMotion`, of
    orientations (T, J, 4) and places (T, J, 3) in the world."""
    rotations, translations = world.copy(), places.copy()
    inner = [joint for joint, parent in enumerate(rig.parents) if parent >= 0]
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
