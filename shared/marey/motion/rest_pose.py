"""Rest poses of a rig: Marey's T-pose, and the A-pose that its characters may be modelled in.

A clip looks the same on both; rotations refer to the offsets, so a change of the pose turns every bone by the shortest
way between its two directions.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

import numpy as np

from marey.core.errors import InvalidInput
from marey.motion.clip import MotionClip
from marey.motion.export_options import RestPose
from marey.motion.io.bvh import BvhClip
from marey.motion.kinematics import forward_kinematics, global_rotations, local_rotations
from marey.motion.rotations import Array, between, length, multiply
from marey.motion.skeleton import SNAPMOGEN, Skeleton, known_order

Clip = TypeVar("Clip", bound=MotionClip | BvhClip)


def _with(skeleton: Skeleton, changed: dict[str, tuple[float, float, float]]) -> Array:
    """Return the offsets of a skeleton with those of some joints, in hundredths of a metre, replaced."""
    offsets = skeleton.offsets.astype(np.float64)
    for name, offset in changed.items():
        offsets[skeleton.index(f"{name}_bind_JNT")] = np.array(offset) * 0.01
    return offsets


A_POSES: dict[str, Array] = {
    SNAPMOGEN.name: _with(
        SNAPMOGEN,
        {
            "C_spine0003": (0, 4.942001, 0),
            "C_neck0002": (0, 3.249985, 0),
            "L_clavicle": (4.59, 12.067001, 0.834),
            "L_armUpper0001": (7.812635, 0.512001, -3.452945),
            "L_armLower0001": (15.265892, -6.552116, -0.058157),
            "L_hand0001": (14.747667, -6.369995, 5.049225),
            "R_clavicle": (-4.59, 12.067001, 0.834),
            "R_armUpper0001": (-7.812635, 0.512001, -3.452945),
            "R_armLower0001": (-15.265892, -6.552116, -0.058157),
            "R_hand0001": (-14.746784, -6.369629, 5.048937),
            "L_legLower0001": (-0.140713, -19.187443, 0.040261),
            "L_foot0001": (-0.132215, -18.028637, -1.13837),
            "L_foot0002": (0.007014, -4.693133, 9.886524),
            "R_legLower0001": (0.140713, -19.187443, 0.040261),
            "R_foot0001": (0.132215, -18.028637, -1.13837),
            "R_foot0002": (-0.007014, -4.693133, 9.886524),
        },
    )
}
"""(J, 3) offsets in metres of the A-pose of a skeleton, by its name."""


def change_rest_pose(clip: Clip, target: RestPose) -> Clip:
    """Return a clip in the other rest pose of its skeleton: a T-pose as A-pose, or an A-pose as T-pose.

    Bones keep their place, except that a bone whose length differs in the two poses moves what hangs on it, by up to
    2 mm on SnapMoGen's rig. Bodies of other proportions keep theirs.

    Raises:
        InvalidInput: no A-pose of the skeleton is known, or bones of the clip change their length.
    """
    tree = clip.skeleton
    known = known_order(tree.joint_names, tree.parents)
    if known is None or known[0].name not in A_POSES:
        raise InvalidInput(
            "no A-pose is known of this skeleton", where=tree.name, hint=f"Skeletons with one: {', '.join(A_POSES)}."
        )
    if isinstance(clip, BvhClip) and clip.positions is not None:
        raise InvalidInput("bones of this clip change their length, so it has no rest pose", where=tree.name)
    ours, order = known
    places = [order.index(j) for j in range(len(order))]  # of each joint of the clip, in our order
    poses = {"t": ours.offsets.astype(np.float64)[places], "a": A_POSES[ours.name][places]}
    source = tree.offsets.astype(np.float64)
    standard = poses["a" if target == "t" else "t"]
    scale = length(source) / np.maximum(length(standard), 1e-9)
    offsets = poses[target] * np.where(length(standard) > 0, scale, 1.0)[:, None]
    offsets[0] = source[0]
    rotations = turn_rest(np.asarray(clip.rotations, np.float64), tree, offsets)
    if isinstance(clip, BvhClip):
        return replace(clip, skeleton=tree.with_offsets(offsets), rotations=rotations)
    joints = forward_kinematics(tree.with_offsets(offsets), rotations, clip.root)
    return replace(
        clip,
        skeleton=tree.with_offsets(offsets),
        rotations=rotations.astype(np.float32),
        joints=joints.astype(np.float32),
    )


def turn_rest(rotations: Array, skeleton: Skeleton, offsets: Array) -> Array:
    """Return local rotations (T, J, 4) on other offsets (J, 3) that give the bones the same directions.

    A joint with several bones is a rigid body and keeps its rotation.
    """
    world = global_rotations(skeleton, rotations)
    single = [j for j in range(len(skeleton)) if len(skeleton.children[j]) == 1]
    below = [skeleton.children[j][0] for j in single]
    source = skeleton.offsets.astype(np.float64)
    world[:, single] = multiply(world[:, single], between(offsets[below], source[below]))
    return local_rotations(skeleton, world)
