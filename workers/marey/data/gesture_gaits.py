"""Loads that are carried on captured walks, and which walks and runs are plain; see `marey.data.gestures`."""

from __future__ import annotations

import random

import numpy as np
from numpy.typing import NDArray

from marey.checks.kinematics import heading
from marey.data.part import FPS, Part
from marey.data.retime import LIMIT
from marey.drawing.gesture import BOTH, SIDES, Gesture
from marey.drawing.parts import arms_of, respond
from marey.posing.standing import ARMS, StandingBody

Array = NDArray[np.floating]

_LEAST_WALK = 36  # frames
_HANGS = 0.2  # metres that the wrists are below the shoulders
_UPRIGHT = 16.0  # degrees of the trunk
_HIPS = 0.78  # metres over the floor
_STRAIGHT = 30.0  # degrees of all turning
_WALKS = (0.6, 1.9)  # m/s
_LEAST_RUN = 20
_RUNS = 3.0  # m/s


def is_plain_walk(part: Part) -> bool:
    """Return True for a straight, upright walk with both arms down."""
    joints = part.joints
    if part.content != "walk" or len(joints) < _LEAST_WALK:
        return False
    trunk = joints[:, 12] - joints[:, 0]
    tilt = np.degrees(np.arccos(trunk[:, 1] / np.linalg.norm(trunk, axis=-1)))
    wrists, shoulders = (joints[:, [ARMS[side][k] for side in SIDES]] for k in (3, 1))
    return bool(
        _WALKS[0] < speed_of(joints) < _WALKS[1]
        and tilt.max() < _UPRIGHT
        and joints[:, 0, 1].min() > _HIPS
        and (shoulders - wrists)[..., 1].min() > _HANGS
        and np.ptp(heading(joints, FPS)) < _STRAIGHT
    )


def is_quick_run(part: Part) -> bool:
    """Return True for a straight run that is fast enough to become a sprint."""
    joints = part.joints
    return (
        part.content == "run"
        and len(joints) >= _LEAST_RUN
        and speed_of(joints) > _RUNS
        and bool(np.ptp(heading(joints, FPS)) < _STRAIGHT)
    )


def speed_of(joints: Array) -> float:
    """Metres per second between the ends of (T, 22, 3)."""
    return float(np.linalg.norm((joints[-1, 0] - joints[0, 0])[[0, 2]])) * FPS / (len(joints) - 1)


_LOADS = {
    "carry-box": {"out": (0.13, 0.2), "up": (-0.43, -0.31), "ahead": (0.24, 0.34), "lean": (-9, 1)},
    "carry-high": {"out": (0.12, 0.2), "up": (-0.21, -0.05), "ahead": (0.27, 0.37), "lean": (-6, 3)},
    "carry-hug": {"out": (-0.07, 0.04), "up": (-0.28, -0.13), "ahead": (0.17, 0.23), "lean": (-8, 2)},
    "carry-shoulder": {"out": (0.16, 0.24), "up": (0.06, 0.14), "ahead": (0.1, 0.17), "lean": (2, 9)},
    "carry-tray": {"out": (0.2, 0.3), "up": (-0.1, 0.06), "ahead": (0.22, 0.32), "lean": (-4, 2)},
}
"""Places of the hands, see `StandingBody.hold`, and the lean of the trunk forward in degrees."""
_ONE_HANDED = ("carry-shoulder", "carry-tray")


def carry(rng: random.Random) -> Gesture:
    form = rng.choices(list(_LOADS), (4, 3, 2, 3, 2))[0]
    side = rng.choice(SIDES) if form in _ONE_HANDED else BOTH
    out, up, ahead, stoop = (rng.uniform(*_LOADS[form][name]) for name in ("out", "up", "ahead", "lean"))
    uneven = rng.uniform(-0.03, 0.03) if form == "carry-hug" else 0.0
    steady, sway = rng.uniform(0.5, 0.9), rng.uniform(2, 7) if form == "carry-shoulder" else 0.0
    elbows = (rng.uniform(0.3, 0.9), -1.0, rng.uniform(-0.5, 0.1) if form != "carry-shoulder" else 0.6)

    def change(body: StandingBody) -> None:
        whole = np.ones(len(body.joints))
        body.steady(steady)
        body.lean(stoop * whole, "left")
        respond(body, whole, side, 0.0, sway)
        for k, one in enumerate(arms_of(side)):
            point = np.array([out, up + (uneven, -uneven)[k], ahead])
            body.hold(one, whole, point, pole=elbows)

    kinds = ("carry", form, *(["carry-both"] if side == BOTH else []))
    return Gesture(0.0, kinds, change, side, base=lambda part: part.joints[:LIMIT].astype(np.float64))
