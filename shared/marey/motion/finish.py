"""Turn a model's features into a finished clip: decode, solve, resample, clean the feet, solve again."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from marey.core.errors import InvalidInput
from marey.motion.clip import MotionClip
from marey.motion.features import FeatureLayout
from marey.motion.feet import clean_feet, find_contacts
from marey.motion.kinematics import forward_kinematics
from marey.motion.pose import solve_pose
from marey.motion.resample import frame_times, interpolate, interpolate_rotations
from marey.motion.rotations import Array


def finish_motion(
    features: Array,
    layout: FeatureLayout,
    *,
    fps: float | None = None,
    clean: bool = True,
    manifest: Mapping[str, Any] | None = None,
) -> MotionClip:
    """Finish a generated motion: fixed bone lengths, and joints that equal the forward kinematics of the rotations.

    Feet are cleaned at the rate of the output, after resampling, so that they stand still there too; bones have their
    final lengths by then, so the second solution is exact.

    Args:
        features: (Tf, D) as generated, not normalized.
        layout: layout of the features.
        fps: rate of the clip; the layout's own by default.
        clean: lock the feet.
        manifest: provenance, for the clip's npz.

    Raises:
        InvalidInput: features of another shape, or a rate out of bounds.
    """
    if features.ndim != 2:
        raise InvalidInput(f"features have shape {features.shape}, not (Tf, {layout.dim})", where=layout.name)
    rate = float(fps or layout.fps)
    pose = solve_pose(layout.decode(features), layout.skeleton, fps=layout.fps)
    skeleton, rotations, root, joints = pose.skeleton, pose.rotations, pose.root, pose.joints
    if rate != layout.fps:
        times = frame_times(len(root), layout.fps, rate)
        rotations, root = interpolate_rotations(rotations, times), interpolate(root, times)
        joints = forward_kinematics(skeleton, rotations, root)
    if clean:
        joints, contacts = clean_feet(joints, skeleton, rate)
        pose = solve_pose(joints, skeleton, fps=rate, measure=False)
        rotations, root = pose.rotations, pose.root
    else:
        contacts = find_contacts(joints, skeleton, rate)
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
