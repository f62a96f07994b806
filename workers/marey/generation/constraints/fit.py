"""Fit a finished motion to constraints: its timing, its path, its poses, its effectors, in this order."""

from __future__ import annotations

import numpy as np

from marey.generation.constraints.constraint_set import ConstraintSet
from marey.generation.constraints.effectors import with_targets
from marey.generation.constraints.paths import asked_places, course_asked, directions
from marey.generation.constraints.playing import played, with_locked_feet
from marey.generation.constraints.poses import BodyMotion, with_poses
from marey.generation.constraints.timing import NO_JUMPS, Timing, find_jumps, play_times
from marey.motion.clip import MotionClip
from marey.motion.courses import Course, bent, gradient, natural_course
from marey.motion.curves import smooth_open, through
from marey.motion.edits.place import posed as clip_of
from marey.motion.rotations import Array
from marey.motion.skeleton import Skeleton
from marey.motion.stance import heading

ARM = 0.35
"""Metres from a target, on the floor, within which the root of a motion without a path need not come nearer."""
MOVE_S = 0.25
TURNING = 0.1
"""Weight of a turn of one radian a second beside speeds that differ by a factor of e."""


def fit_clip(clip: MotionClip, asked: ConstraintSet) -> MotionClip:
    """Return a clip of `asked.frames` frames that meets constraints, in the space of these."""
    skeleton, fps = clip.skeleton, asked.fps
    motion = played(clip, timing(clip.joints.astype(np.float64), asked, skeleton))
    natural = natural_course(motion.joints(skeleton), skeleton, fps)
    wanted = _course(motion, natural, asked, skeleton)
    if wanted is not None:
        motion = BodyMotion(*bent(motion.rotations, motion.root, motion.contacts, natural, wanted, skeleton, fps))
        motion = with_locked_feet(motion, skeleton, fps)  # what is left of slides after stands were carried as a whole
    motion = with_poses(motion, asked.keyframes, skeleton, fps)
    motion = with_targets(motion, asked.targets, skeleton, fps)
    return clip_of(clip, motion.rotations, motion.root, contacts=motion.contacts)


def timing(joints: Array, asked: ConstraintSet, skeleton: Skeleton) -> Timing:
    """Return which moments of a motion (N, J, 3) frames show."""
    weight, speeds = np.zeros(asked.frames), np.zeros(asked.frames)
    natural = natural_course(joints, skeleton, asked.fps)
    jumps = NO_JUMPS
    if asked.paths and asked.retimed:
        places, end = asked_places(asked)
        speeds = np.linalg.norm(gradient(places), axis=1) * asked.fps
        weight[: end + 1] = 1.0
        jumps = find_jumps(joints, natural.speeds(asked.fps), skeleton, asked.fps)
    return play_times(natural.speeds(asked.fps), speeds, weight, asked.fps, jumps)


def misfit(joints: Array, asked: ConstraintSet, skeleton: Skeleton) -> float:
    """Return how much a motion (N, J, 3) has to be changed to follow a path, 0 or more: speeds, and turns."""
    shown = timing(joints, asked, skeleton)
    natural = natural_course(joints, skeleton, asked.fps)
    turning = np.interp(shown.times, np.arange(len(joints)), gradient(natural.headings[:, None])[:, 0])
    wanted = gradient(directions(asked_places(asked)[0], asked.fps, 0.0)[:, None])[:, 0]
    return shown.cost + TURNING * float((((wanted - turning) * asked.fps) ** 2).mean())


def _course(motion: BodyMotion, natural: Course, asked: ConstraintSet, skeleton: Skeleton) -> Course | None:
    """Return the course that a motion has to take; None = its own."""
    if asked.paths:
        return course_asked(asked, natural)
    knots = _knots(motion, asked, skeleton)
    if not knots:
        return None
    frames = np.array([0, *knots], np.float64)
    values = np.array([[0.0, 0.0, 0.0], *knots.values()])
    if frames[1] == 0:
        frames, values = frames[1:], values[1:]
    at = np.minimum(np.arange(asked.frames, dtype=np.float64), frames[-1])
    change = smooth_open(through(frames, values, at), MOVE_S * asked.fps)
    return Course(natural.places + change[:, :2], natural.headings + change[:, 2])


def _knots(motion: BodyMotion, asked: ConstraintSet, skeleton: Skeleton) -> dict[int, Array]:
    """Return how far, in X, Z and heading, the root has to move and turn at frames, without a path."""
    found: dict[int, Array] = {}
    joints = motion.joints(skeleton)
    for target in asked.targets:
        for frame, place in zip(target.frames, target.places, strict=True):
            way = (place - joints[frame, target.joint])[[0, 2]]
            far = float(np.linalg.norm(way))
            found[frame] = np.append(way * max(0.0, 1 - ARM / max(far, 1e-9)), 0.0)
    for key in asked.keyframes:
        if key.root is not None:
            turn = heading(key.rotations, skeleton) - heading(motion.rotations[key.frame], skeleton)
            turn = np.arctan2(np.sin(turn), np.cos(turn))
            found[key.frame] = np.append((key.root - motion.root[key.frame])[[0, 2]], turn)
    ordered = dict(sorted(found.items()))
    return ordered if any(np.abs(value).max() > 1e-6 for value in ordered.values()) else {}
