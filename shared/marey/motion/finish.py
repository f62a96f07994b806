"""Turn a model's features into a finished clip: decode, solve onto the body, resample, clean the feet, solve again,
and turn the toes and hands.

A layout with the rotations of its skeleton (`PosedLayout`) gives the pose itself: nothing is solved from positions, and
after the clean-up only the bones that it moved are turned.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from marey.core.errors import InvalidInput
from marey.motion.body import NamedBody, standard_body, travel_scale
from marey.motion.bones import bone_fit
from marey.motion.carrying import carrying_contacts
from marey.motion.clip import MotionClip
from marey.motion.ends import turn_ends
from marey.motion.features import FeatureLayout, PosedLayout
from marey.motion.feet import clean_feet, find_contacts, need_feet, rule_for
from marey.motion.hands import clear_arms, join_hands, wrist_distance
from marey.motion.kinematics import forward_kinematics
from marey.motion.pivoting import on_balls
from marey.motion.pose import aim_bones, checked_joints, solve_pose
from marey.motion.resample import frame_times, interpolate, interpolate_rotations
from marey.motion.rotations import Array, unroll
from marey.motion.running import on_its_steps, running_frames, with_flights, with_running_steps
from marey.motion.skeleton import Skeleton

CLEANED = "feet_cleaned"
"""Key of a manifest: whether the feet were locked."""


def finish_motion(
    features: Array,
    layout: FeatureLayout,
    *,
    body: NamedBody | None = None,
    fps: float | None = None,
    clean: bool = True,
    manifest: Mapping[str, Any] | None = None,
) -> MotionClip:
    """Finish a generated motion: the bones of one body, and joints that equal the forward kinematics of the rotations.

    The pose is solved on the skeleton of the training data, which the model learned, and turned to rotations, unless
    the layout holds them; the body takes those, and its travel is scaled by the length of its legs. Feet are cleaned at
    the rate of the output, after resampling, so that they stand still there too; hands that meet are brought as near as
    they were decoded, and arms out of the body; the second solution is exact. Toes and hands, whose turns no joint
    shows, are turned at the end (`marey.motion.ends`).

    Args:
        features: (Tf, D) as generated, not normalized.
        layout: layout of the features, with the skeleton of the training data.
        body: skeleton of the clip; None = `standard_body` of the layout's.
        fps: rate of the clip; the layout's own by default.
        clean: lock the feet, and correct hands that meet and arms inside the body.
        manifest: provenance, for the clip's npz.

    Raises:
        InvalidInput: features of another shape or with numbers that are not finite, a skeleton without feet, or a rate
            out of bounds.
    """
    if features.ndim != 2:
        raise InvalidInput(f"features have shape {features.shape}, not (Tf, {layout.dim})", where=layout.name)
    need_feet(layout.skeleton)
    rate = float(fps or layout.fps)
    skeleton = (body or standard_body(layout.skeleton)).skeleton
    rotations, root, hands = _pose_on(skeleton, features, layout)
    if rate != layout.fps:
        times = frame_times(len(root), layout.fps, rate)
        rotations, root = interpolate_rotations(rotations, times), interpolate(root, times)
        hands = interpolate(hands, times)
    joints = forward_kinematics(skeleton, rotations, root)
    if clean:
        joints = on_balls(joints, skeleton, rate)
        going = running_frames(joints, skeleton, rate)
        joints = on_its_steps(joints, going, skeleton, rate)
        contacts = carrying_contacts(joints, skeleton, rate, rule=rule_for(joints, rate))
        contacts = with_running_steps(joints, contacts, going, skeleton, rate)
        joints = with_flights(joints, contacts, going, skeleton, rate)
        joints, contacts = clean_feet(joints, skeleton, rate, contacts=contacts)
        joints = clear_arms(join_hands(joints, hands, skeleton), skeleton, rate)
        if isinstance(layout, PosedLayout):
            rotations, root = aim_bones(joints, rotations, skeleton), joints[:, 0]
        else:
            rotations, root = _solve(joints, skeleton, rate)
    else:
        contacts = find_contacts(joints, skeleton, rate)
    if not isinstance(layout, PosedLayout):  # its features turn every joint
        rotations = turn_ends(rotations, root, contacts, skeleton, rate)
    return MotionClip.of(
        skeleton,
        rotations,
        root,
        contacts,
        rate,
        features=features,
        features_fps=layout.fps,
        manifest=manifest,
    )


def _pose_on(skeleton: Skeleton, features: Array, layout: FeatureLayout) -> tuple[Array, Array, Array]:
    """Return rotations (Tf, J, 4), root (Tf, 3) and distances of the wrists (Tf,) of features on the skeleton of a
    body."""
    decoded = checked_joints(layout.decode(features), layout.skeleton)
    rotations, root = _pose(features, decoded, layout)
    scale = travel_scale(layout.skeleton, skeleton)
    return rotations, scale * root, scale * wrist_distance(decoded, layout.skeleton)


def _pose(features: Array, decoded: Array, layout: FeatureLayout) -> tuple[Array, Array]:
    """Return rotations (Tf, J, 4) and root (Tf, 3) of features: the layout's own, or those that are solved from its
    joints (Tf, J, 3)."""
    if isinstance(layout, PosedLayout):
        rotations, root = layout.decode_pose(features)
        return unroll(rotations), root
    return _solve(bone_fit(layout.skeleton).fit(decoded), layout.skeleton, layout.fps)


def _solve(joints: Array, skeleton: Skeleton, fps: float) -> tuple[Array, Array]:
    """Return rotations (T, J, 4) and root (T, 3) of joints (T, J, 3) whose bones are the skeleton's."""
    pose = solve_pose(joints, skeleton, fps=fps, measure=False)
    return pose.rotations, pose.root
