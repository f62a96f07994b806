"""A motion to retarget: the body that it was made on, and how its parts move."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from marey.core.errors import InvalidInput
from marey.motion.clip import MotionClip
from marey.motion.io.bvh import BvhClip
from marey.motion.kinematics import forward_kinematics, global_rotations
from marey.motion.rigs.body import RigBody
from marey.motion.rigs.rig import Rig
from marey.motion.rotations import Array, conjugate, multiply
from marey.motion.skeleton import Skeleton


@dataclass(frozen=True, eq=False)
class Source:
    """Poses of a body over time.

    Attributes:
        body: the body.
        turned: (T, J, 4) how far each joint has turned from the upright rest pose, in the world.
        joints: (T, J, 3) places, metres.
        contacts: (T, 4) bool, True where L ankle, L toe, R ankle, R toe stand.
        fps: frames a second.
        manifest: provenance of the motion.
    """

    body: RigBody
    turned: Array = field(repr=False)
    joints: Array = field(repr=False)
    contacts: NDArray[np.bool_] = field(repr=False)
    fps: float
    manifest: Mapping[str, Any] = field(default_factory=dict[str, Any], repr=False)

    def turns(self, part: str) -> Array:
        """Return how far a part has turned (T, 4)."""
        return self.turned[:, self.body.map.parts[part]]

    def places(self, part: str) -> Array:
        """Return where a part is (T, 3), metres."""
        return self.joints[:, self.body.map.parts[part]]


def source_of(clip: MotionClip) -> Source:
    """Return the motion of a clip.

    Raises:
        InvalidInput: its skeleton has no legs that can be told.
    """
    body = body_of(clip.skeleton)
    rotations = clip.rotations.astype(np.float64)
    world = global_rotations(clip.skeleton, rotations)
    joints = forward_kinematics(clip.skeleton, rotations, clip.root.astype(np.float64), world=world)
    turned = multiply(world, conjugate(body.upright))
    return Source(body, turned, joints, clip.contacts, clip.fps, clip.manifest)


def rig_of(skeleton: Skeleton) -> Rig:
    """Return a skeleton as a rig: the T-pose with the lowest joint on the floor, all axes along the world's."""
    places = skeleton.rest.astype(np.float64)
    places[:, 1] -= places[:, 1].min()
    count = len(skeleton)
    return Rig(
        name=skeleton.name,
        joint_names=skeleton.joint_names,
        parents=skeleton.parents,
        positions=places,
        orientations=np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)),
        scales=np.ones(count),
        bones=(True,) * count,
        tips=np.full((count, 3), np.nan),
    )


@lru_cache(maxsize=64)
def _body_of(name: str, names: tuple[str, ...], parents: tuple[int, ...], offsets: bytes) -> RigBody:
    places = np.frombuffer(offsets, np.float32).reshape(-1, 3)
    return RigBody.of(rig_of(Skeleton(name, names, parents, places, tuple(range(len(names))))))


def body_of(skeleton: Skeleton) -> RigBody:
    """Return the body of a skeleton; remembered, since many motions have the same one.

    Raises:
        InvalidInput: it has no legs that can be told.
    """
    return _body_of(skeleton.name, skeleton.joint_names, skeleton.parents, skeleton.offsets.tobytes())


def source_on(body: RigBody, clip: BvhClip) -> Source:
    """Return a BVH clip as a motion of a rig whose rest pose is known from another file, such as one that begins with a
    T-pose; no foot of it stands.

    Args:
        body: the rig, with the joints of the clip in any order.
        clip: the motion.

    Raises:
        InvalidInput: a joint of the rig is not in the clip.
    """
    names = clip.skeleton.joint_names
    missing = [name for name in body.rig.joint_names if name not in names]
    if missing:
        raise InvalidInput(f"the motion has no joint {missing[0]!r}", where=body.rig.name)
    order = [names.index(name) for name in body.rig.joint_names]
    world = global_rotations(clip.skeleton, clip.rotations)[:, order]
    turned = multiply(world, conjugate(multiply(body.upright, body.rig.orientations)))
    stands = np.zeros((len(world), 4), bool)
    return Source(body, turned, clip.joints()[:, order], stands, clip.fps)
