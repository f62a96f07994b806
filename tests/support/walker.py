"""A drawn walk: a clip whose every joint is known, for tests that need motion and no capture data."""

from __future__ import annotations

import numpy as np

from marey.motion import rotations
from marey.motion.clip import MotionClip
from marey.motion.kinematics import forward_kinematics
from marey.motion.skeleton import HUMANML3D, Skeleton


def walker(
    *,
    seconds: float = 2.0,
    fps: float = 20.0,
    turn: float = 0.0,
    skeleton: Skeleton = HUMANML3D,
    prompt: str = "a person walks",
) -> MotionClip:
    """Walk at 1.1 m/s with the left hand up, facing +Z first; `turn` is the yaw rate, rad/s, positive to the left."""
    time = np.arange(round(seconds * fps) + 1) / fps
    frames = len(time)
    local = np.tile(rotations.IDENTITY, (frames, len(skeleton), 1))
    phase = 2 * np.pi * 0.9 * time
    swing, yaw = 0.5 * np.sin(phase), turn * time
    pose = {
        "pelvis": rotations.about("Y", yaw),
        "L_hip": rotations.about("X", -swing),
        "R_hip": rotations.about("X", swing),
        "L_knee": rotations.about("X", 0.4 * (1 - np.cos(phase + 0.5))),
        "R_knee": rotations.about("X", 0.4 * (1 + np.cos(phase + 0.5))),
        "R_shoulder": rotations.multiply(rotations.about("X", -swing), rotations.about("Z", np.full(frames, 1.2))),
        "L_shoulder": rotations.about("Z", np.full(frames, 0.5)),
        "L_elbow": rotations.about("Z", 0.9 + 0.5 * np.sin(2 * phase)),
    }
    for name, turned in pose.items():
        local[:, skeleton.index(name)] = turned
    path = np.cumsum(1.1 / fps * np.stack([np.sin(yaw), 0 * yaw, np.cos(yaw)], axis=-1), axis=0)
    root = path - path[:1] + np.array([0.0, 1.0, 0.0])
    root[:, 1] -= forward_kinematics(skeleton, local, root)[..., 1].min(axis=-1)
    joints = forward_kinematics(skeleton, local, root)
    contacts = joints[:, list(skeleton.feet), 1] < np.array([0.09, 0.03, 0.09, 0.03])
    return MotionClip.of(skeleton, local, root, contacts, fps, manifest={"prompt": prompt, "seed": 7})
