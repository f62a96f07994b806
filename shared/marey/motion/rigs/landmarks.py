"""Feet, hips and shoulders of a skeleton whose joints have names of their own."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from marey.core.errors import InvalidInput
from marey.motion.rigs.joint_map import JointMap, map_joints
from marey.motion.rigs.parts import SIDES
from marey.motion.rigs.rig import Rig
from marey.motion.rotations import IDENTITY
from marey.motion.skeleton import Skeleton


@lru_cache(maxsize=64)
def map_names(joint_names: tuple[str, ...], parents: tuple[int, ...]) -> JointMap:
    """Return the parts of a tree by the names of its joints alone.

    Raises:
        InvalidInput: no legs are found.
    """
    count = len(joint_names)
    rig = Rig(
        name="skeleton",
        joint_names=joint_names,
        parents=parents,
        positions=np.zeros((count, 3)),
        orientations=np.tile(IDENTITY, (count, 1)),
        scales=np.ones(count),
        bones=(True,) * count,
        tips=np.full((count, 3), np.nan),
    )
    return map_joints(rig)


def feet_and_facing(skeleton: Skeleton) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Find the feet (L ankle, L toe, R ankle, R toe) and facing joints (r_hip, l_hip, r_shoulder, l_shoulder) of a
    skeleton by names; each is empty if any of its joints is not found."""
    try:
        parts = map_names(skeleton.joint_names, skeleton.parents).parts
    except InvalidInput:
        return (), ()
    feet = [parts.get(f"{side}_{part}") for side in SIDES for part in ("foot", "toes")]
    looks = [parts.get(f"{side}_{part}") for part in ("upper_leg", "upper_arm") for side in reversed(SIDES)]
    return tuple(j for j in feet if j is not None and None not in feet), tuple(
        j for j in looks if j is not None and None not in looks
    )
