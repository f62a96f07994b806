"""Bodies that move as a test says: the rest pose, arms hanging, with joints displaced over time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from marey.motion.skeleton import HUMANML3D
from marey.referee import Body

FPS = 30.0
Joints = NDArray[np.float64]


def seconds(length: float) -> Joints:
    """(T,) times of the frames of a clip."""
    return np.arange(round(length * FPS)) / FPS


def standing(length: float) -> Joints:
    """(T, 22, 3) a body that stands still with hanging arms."""
    pose = HUMANML3D.rest.astype(np.float64)
    for side, sign in (("L", 1.0), ("R", -1.0)):
        shoulder = pose[HUMANML3D.index(f"{side}_shoulder")]
        pose[HUMANML3D.index(f"{side}_elbow")] = shoulder + np.array([sign * 0.05, -0.265, 0.0])
        pose[HUMANML3D.index(f"{side}_wrist")] = shoulder + np.array([sign * 0.08, -0.51, 0.05])
    return np.repeat(pose[None], len(seconds(length)), axis=0)


def arm_to(joints: Joints, side: str, hand: Joints) -> Joints:
    """Put a wrist at (T, 3) offsets from its shoulder, the elbow half way and a little outward."""
    moved = joints.copy()
    shoulder = moved[:, HUMANML3D.index(f"{side}_shoulder")]
    moved[:, HUMANML3D.index(f"{side}_wrist")] = shoulder + hand
    outward = np.array([0.08 if side == "L" else -0.08, -0.05, 0.0])
    moved[:, HUMANML3D.index(f"{side}_elbow")] = shoulder + hand / 2 + outward
    return moved


def tipped(joints: Joints, degrees: Joints) -> Joints:
    """Tip everything over the hips forward about them."""
    upper = [i for i, name in enumerate(HUMANML3D.joint_names) if name.split("_")[-1] not in LEGS]
    angle = np.deg2rad(degrees)[:, None]
    moved = joints.copy()
    part = moved[:, upper] - moved[:, :1]
    y, z = part[..., 1].copy(), part[..., 2].copy()
    part[..., 1] = y * np.cos(angle) - z * np.sin(angle)
    part[..., 2] = y * np.sin(angle) + z * np.cos(angle)
    moved[:, upper] = part + moved[:, :1]
    return moved


LEGS = {"pelvis", "hip", "knee", "ankle", "foot"}


def walking(length: float, speed: float, cadence: float = 1.8, flight: float = 0.0) -> Joints:
    """A gait along +Z: the feet stand and swing in turn; `flight` lifts the whole body between two steps, metres."""
    joints, time = standing(length), seconds(length)
    joints[..., 2] += (speed * time)[:, None]
    stride = 2 * speed / cadence
    for side, phase in (("L", 0.0), ("R", 0.5)):
        turn = (time * cadence / 2 + phase) % 1.0
        swing = np.clip((turn - 0.5) * 2, 0, 1)
        ahead = np.where(turn < 0.5, stride * (0.25 - turn), stride * (swing - 0.5) * 0.5)
        lift = 0.12 * np.sin(np.pi * swing)
        for joint, share in (("knee", 0.5), ("ankle", 1.0), ("foot", 1.0)):
            index = HUMANML3D.index(f"{side}_{joint}")
            joints[:, index, 2] += share * ahead
            joints[:, index, 1] += share * lift
    joints[..., 1] += flight * np.abs(np.sin(np.pi * (time * cadence + 0.5)))[:, None]
    return joints


def body(joints: Joints) -> Body:
    """Measure these joints."""
    return Body(joints, FPS)
