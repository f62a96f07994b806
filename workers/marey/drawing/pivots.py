"""Turns on the ball of one foot: pirouettes, and spins of skaters."""

from __future__ import annotations

import random

import numpy as np
from numpy.typing import NDArray

from marey.checks.kinematics import heading
from marey.drawing.gesture import SIDES, Gesture
from marey.drawing.placed import about_vertical, posed, spine_yaw
from marey.motion.rotations import from_rotvec, rotate
from marey.posing.limbs import FPS, LEG_CHAINS, LEVEL
from marey.posing.standing import SIGN, StandingBody, eased

Array = NDArray[np.floating]

_TOES = [10, 11]
_HANDS = {
    "round": ((0.08, 0.14), (-0.22, -0.14), (0.32, 0.38)),
    "up": ((0.03, 0.09), (0.36, 0.44), (0.08, 0.16)),
    "in": ((-0.02, 0.05), (-0.2, -0.1), (0.22, 0.27)),
}
"""Places of the hands in a ring before the chest, over the head, or at the chest; see `StandingBody.hold`."""
_RATES = {"slow": (200.0, 230.0), "": (300.0, 350.0), "fast": (430.0, 500.0)}
"""Degrees a second of a spin on one foot, by its pace."""
_LONGEST_S = 7.5
"""Seconds of the turns together at most."""
_SHIFTS_S = (0.4, 0.5)
"""Seconds in which the weight comes onto the foot, and leaves it."""


def pirouette(
    rng: random.Random,
    side: str,
    turns: int = 1,
    *,
    arms: str = "",
    pace: str = "",
    waits: tuple[float, float],
    foot: str = "",
) -> Gesture:
    """Whole turns on the ball of one foot, the other foot drawn up.

    Args:
        rng: decides what is not given.
        side: left or right.
        turns: how many.
        arms: round, up or in; empty = any.
        pace: slow, fast or empty.
        waits: seconds that the body stands before it and after it.
        foot: on which it turns, left or right; empty = that of the side to which it turns.
    """
    pivot, form = SIDES.index(foot or side), arms or rng.choice(list(_HANDS))
    shift, start, rate = rng.uniform(*_SHIFTS_S), waits[0], rng.uniform(*_RATES[pace])
    lasts = min(450.0 * turns / rate, _LONGEST_S)
    wound, heel, lift = rng.uniform(12, 22), rng.uniform(20, 32), rng.uniform(0.2, 0.3)
    hands = np.array([rng.uniform(*limits) for limits in _HANDS[form]])
    end = start + shift + lasts

    def change(body: StandingBody) -> None:
        t = np.arange(len(body.joints)) / FPS
        on_foot = eased((t - start) / shift) * (1 - eased((t - end) / shift))
        arms = eased((t - start) / (shift + 0.2)) * (1 - eased((t - end + 0.15) / (shift + 0.2)))
        winds = eased((t - start) / shift) * (1 - eased((t - start - shift) / 0.3))
        for one in SIDES:
            body.hold(one, arms, hands, lag=0.03)
        x = np.clip((t - start - shift) / lasts, 0.0, 1.0)
        yaw = SIGN[side] * np.radians(360.0 * turns) * (0.6 * eased(x) + 0.4 * ramped(x))
        shoulders = yaw - SIGN[side] * np.radians(wound) * winds
        body.joints[:] = about_foot(body.joints, pivot, yaw, shoulders, on_foot, np.array([heel, lift]))

    return Gesture(end + shift + waits[1], ("spin", "spin-foot"), change, side, turns)


def about_foot(joints: Array, foot: int, yaw: Array, shoulders: Array, on_foot: Array, drawn: Array) -> Array:
    """Turn an idle (T, 22, 3) about a toe.

    Args:
        joints: the idle.
        foot: 0 (left) or 1.
        yaw, shoulders: radians (T,) of the hips and of the shoulders.
        on_foot: (T,) share of the weight that is on the foot alone.
        drawn: degrees by which its heel rises, and metres by which the other foot is lifted.
    """
    local = about_vertical(joints, np.full(joints.shape[:2], -np.radians(heading(joints, FPS)[0])))
    pivot = (local[0, _TOES[foot]] * LEVEL)[None]
    local = local - pivot
    toes = local[:, _TOES].copy()
    over = on_foot[:, None] * (-0.8 * local[:, 0] * LEVEL)
    root = local[:, 0] + over
    toes[:, 1 - foot] += on_foot[:, None] * (0.6 * (root * LEVEL - toes[:, 1 - foot] * LEVEL) + [0, drawn[1], 0])
    away = 1 if foot == 0 else -1
    toes[:, 1 - foot, 0] -= on_foot * away * 0.09
    toes[:, 1 - foot, 2] += on_foot * 0.05
    for side, (_, _, ankle, toe) in enumerate(LEG_CHAINS):
        pitch = np.zeros((len(local), 3))
        pitch[:, 0] = np.radians(drawn[0] if side == foot else 35.0) * on_foot
        local[:, toe] = local[:, ankle] + rotate(from_rotvec(pitch), local[:, toe] - local[:, ankle])
    root[:, 1] += 0.1 * np.sin(np.radians(drawn[0])) * on_foot
    turned = np.repeat(yaw[:, None], 2, axis=1)
    return posed(local, about_vertical(root, yaw), spine_yaw(yaw, shoulders), about_vertical(toes, turned), turned)


def ramped(x: Array) -> Array:
    """Even progress with short soft ends, 0 to 1."""
    return np.where(x < 0.5, 0.5 * (2 * x) ** 1.3, 1 - 0.5 * (2 - 2 * x) ** 1.3)
