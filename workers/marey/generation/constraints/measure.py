"""How far a finished motion is from its constraints."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from marey.generation.constraints.constraint_set import ConstraintSet, Keyframe, Path, Target
from marey.items.constraints import EFFECTOR_TARGET, POSE_KEYFRAME, ROOT_PATH
from marey.motion.clip import MotionClip
from marey.motion.filters import smooth
from marey.motion.kinematics import facing, forward_kinematics
from marey.motion.resample import interpolate
from marey.motion.rotations import Array, about, angle_between, multiply, rotate
from marey.motion.skeleton import Skeleton
from marey.motion.stance import heading
from marey.quality.constraints import ConstraintError


def constraint_errors(clip: MotionClip, asked: ConstraintSet) -> list[ConstraintError]:
    """Measure a clip in the space of its constraints; in their order."""
    return sorted(_errors(clip, asked), key=lambda each: each.index)


def _errors(clip: MotionClip, asked: ConstraintSet) -> Iterator[ConstraintError]:
    for path in asked.paths:
        yield _path_error(clip, path)
    for key in asked.keyframes:
        yield _pose_error(clip, key)
    for target in asked.targets:
        yield _target_error(clip, target)


def headings_of(clip: MotionClip, sigma_s: float = 0.25) -> Array:
    """Return the smoothed heading (T,) of a body, radians, unwrapped."""
    ahead = smooth(facing(clip.joints.astype(np.float64), clip.skeleton), sigma_s * clip.fps)
    return np.unwrap(np.arctan2(ahead[:, 0], ahead[:, 2]))


def _path_error(clip: MotionClip, path: Path) -> ConstraintError:
    root = interpolate(clip.root[:, [0, 2]].astype(np.float64), path.frames)
    far = np.linalg.norm(root - path.places, axis=1)
    turn = None
    if path.headings is not None:
        own = np.interp(path.frames, np.arange(clip.frames), headings_of(clip))
        turn = float(np.degrees(np.abs(wrapped(own - path.headings)).mean()))
    return ConstraintError.of(path.number, ROOT_PATH, float(far.mean()), float(far.max()), turn)


def _pose_error(clip: MotionClip, key: Keyframe) -> ConstraintError:
    joints = clip.joints[key.frame].astype(np.float64)
    root = np.zeros(3) if key.root is None else key.root
    wanted = forward_kinematics(clip.skeleton, key.rotations[None], root[None])[0]
    if key.root is None:
        joints = joints - joints[0]
        turn = heading(clip.rotations[key.frame].astype(np.float64), clip.skeleton)
        wanted = rotate(about("Y", turn - heading(key.rotations, clip.skeleton)), wanted)
    far = np.linalg.norm(joints - wanted, axis=1)
    return ConstraintError.of(key.number, POSE_KEYFRAME, float(far.mean()), float(far.max()), None)


def _target_error(clip: MotionClip, target: Target) -> ConstraintError:
    at = list(target.frames)
    far = np.linalg.norm(clip.joints[at, target.joint] - target.places, axis=1)
    turn = None
    if target.rotations is not None:
        own = world_rotation(clip.skeleton, clip.rotations[at].astype(np.float64), target.joint)
        turn = float(np.degrees(angle_between(own, target.rotations).mean()))
    return ConstraintError.of(target.number, EFFECTOR_TARGET, float(far.mean()), float(far.max()), turn)


def world_rotation(skeleton: Skeleton, rotations: Array, joint: int) -> Array:
    """Return the world rotation (T, 4) of one joint."""
    world = rotations[:, joint]
    while (joint := skeleton.parents[joint]) >= 0:
        world = multiply(rotations[:, joint], world)
    return world


def wrapped(angle: Array) -> Array:
    """Return angles within a half turn of zero."""
    return np.arctan2(np.sin(angle), np.cos(angle))
