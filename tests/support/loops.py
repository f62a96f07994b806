"""Motions of which loops are made."""

from __future__ import annotations

import numpy as np

from marey.motion import MotionClip, edit
from marey.motion.feet import find_contacts
from marey.motion.pose import solve_pose
from marey.motion.rotations import from_rotvec, multiply
from marey.motion.skeleton import HUMANML3D
from tests.support import bodies
from tests.support.motions import drift

LOOP = {"op": "loop"}


def walked(seconds: float = 6.0) -> MotionClip:
    """A walk that sways a little, so that no two cycles are equal."""
    return swaying(bodies.Body(seconds, speed=lambda t: 1.1 + 0 * t))


def swaying(body: bodies.Body) -> MotionClip:
    """A body whose arms and trunk swing with its steps, and drift a little."""
    pose = solve_pose(body.joints(), HUMANML3D, fps=bodies.FPS)
    rotations, phase = pose.rotations.copy(), np.pi * body.cadence * np.arange(len(pose.root)) / bodies.FPS
    for number, name in enumerate(("spine1", "spine2", "neck", "L_shoulder", "R_shoulder", "L_elbow", "R_elbow")):
        joint = HUMANML3D.index(name)
        swing = np.outer(np.sin(phase + (np.pi if name[0] == "L" else 0.0)), [0.4, 0.1, 0.1])
        rotations[:, joint] = multiply(rotations[:, joint], from_rotvec(swing + drift(number, len(rotations), 3, 0.01)))
    root = pose.root + np.outer(np.sin(2 * phase), [0.0, 0.01, 0.02])
    contacts = find_contacts(pose.joints, pose.skeleton, bodies.FPS)
    return MotionClip.of(pose.skeleton, rotations, root, contacts, bodies.FPS)


def run() -> MotionClip:
    """A run of four steps; its right foot never stands still for two frames."""
    return swaying(bodies.Body(1.4, speed=lambda t: 3.5 + 0 * t, duty=0.2, cadence=3.0))


def idle(seconds: float) -> MotionClip:
    """A body that sways on standing feet."""
    frames = round(20 * seconds)
    rotations = np.zeros((frames, 22, 4))
    rotations[..., 0] = 1.0
    arms = from_rotvec(drift(3, frames, 3, 0.08))
    for name in ("spine2", "L_shoulder", "R_shoulder"):
        joint = HUMANML3D.index(name)
        rotations[:, joint] = multiply(arms, rotations[:, joint])
    root = np.tile([0.0, 0.94, 0.0], (frames, 1))
    return MotionClip.of(HUMANML3D, rotations, root, np.ones((frames, 4), bool), 20.0)


def thrice(loop: MotionClip) -> MotionClip:
    (played,) = edit(loop, [{"op": "concat", "with": loop}] * 2)
    return played
