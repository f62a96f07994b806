"""Spins on the ball of one foot, of captured idles, and turns in the air, of captured jumps."""

from __future__ import annotations

import random

import numpy as np
from numpy.typing import NDArray

from marey.checks.kinematics import heading
from marey.data.gesture_steps import small_step_spin
from marey.data.part import FPS, Part
from marey.data.retarget import resample_points
from marey.drawing.gesture import SIDES, Gesture
from marey.drawing.pivots import about_foot, ramped
from marey.drawing.placed import about_vertical, posed, spine_yaw
from marey.posing.bones import with_bones
from marey.posing.limbs import LEVEL
from marey.posing.standing import LEFT, StandingBody, eased

Array = NDArray[np.floating]

_TOES = [10, 11]
_ARMS_IN = {
    "in": ((-0.04, 0.06), (-0.2, -0.08), (0.2, 0.27)),
    "round": ((0.06, 0.14), (-0.22, -0.06), (0.32, 0.4)),
    "up": ((0.02, 0.1), (0.34, 0.46), (0.06, 0.16)),
}
"""Places of the hands before the chest, in a ring, or over the head; see `StandingBody.hold`."""
_RATES = (260, 420)  # degrees a second of a spin on one foot
_ALOFT = 0.07  # metres of both toes over where they stand
_LEAST_FLIGHT = 0.2
"""Seconds in the air of a jump that may turn."""
_UPRIGHT = 0.8  # metres of the hips at both ends
_AFTER = 8  # frames after landing at least
_FASTEST = 560.0  # degrees a second of a turn in the air
_FACES = 0.1  # seconds by which the hips begin to turn before the feet leave the floor, and end after they land


def spin(rng: random.Random) -> Gesture:
    return small_step_spin(rng) if rng.random() < 0.45 else _one_foot_spin(rng)


def _one_foot_spin(rng: random.Random) -> Gesture:
    """A spin on the ball of the foot of the side to which it turns, the other foot drawn up."""
    side, turns, form = rng.choice(SIDES), rng.choice((1, 1, 1, 2, 2, 3)), rng.choice(list(_ARMS_IN))
    sign, foot = (1.0, 0) if side == LEFT else (-1.0, 1)
    shift, start = rng.uniform(0.35, 0.55), rng.uniform(0.2, 0.9)
    lasts = 360.0 * turns / rng.uniform(*_RATES) * 1.25
    wound, heel, lift = rng.uniform(8, 25), rng.uniform(12, 30), rng.uniform(0.08, 0.3)
    hands = np.array([rng.uniform(*limits) for limits in _ARMS_IN[form]])
    end = start + shift + lasts

    def change(body: StandingBody) -> None:
        t = np.arange(len(body.joints)) / FPS
        on_foot = eased((t - start) / shift) * (1 - eased((t - end) / shift))
        arms = eased((t - start - 0.2) / shift) * (1 - eased((t - end + 0.15) / (shift + 0.25)))
        winds = eased((t - start) / shift) * (1 - eased((t - start - shift) / 0.3))
        for one in SIDES:
            body.hold(one, arms, hands, lag=0.03)
        x = np.clip((t - start - shift) / lasts, 0.0, 1.0)
        yaw = sign * np.radians(360.0 * turns) * (0.6 * eased(x) + 0.4 * ramped(x))
        shoulders = yaw - sign * np.radians(wound) * winds
        body.joints[:] = about_foot(body.joints, foot, yaw, shoulders, on_foot, np.array([heel, lift]))

    count = {1: "spin-once", 2: "spin-twice"}.get(turns, "spin-many")
    return Gesture(end + shift + rng.uniform(0.3, 0.9), ("spin", "spin-foot", count), change, side)


def is_single_jump(part: Part) -> bool:
    """Return True for one jump of both feet from and to the floor, on the spot or ahead."""
    if part.content not in ("jump", "jump-forward", "jump-turn"):
        return False
    joints, flight = part.joints, _flight(part.joints)
    upright = min(joints[0, 0, 1], joints[-1, 0, 1]) > _UPRIGHT
    return flight is not None and upright and len(joints) - flight[1] > _AFTER and abs(_turned(joints)) < 120


def _turned(joints: Array) -> float:
    angle = heading(joints, FPS)
    return float(angle[-1] - angle[0])


def _flight(joints: Array) -> tuple[int, int] | None:
    """First and last frame of the only flight of (T, 22, 3), None if there are none or several."""
    toes = joints[:, _TOES, 1]
    aloft = np.all(toes - np.percentile(toes, 20, axis=0) > _ALOFT, axis=1)
    edges = np.flatnonzero(aloft[1:] != aloft[:-1])
    if len(edges) != 2 or aloft[0] or edges[1] - edges[0] < _LEAST_FLIGHT * FPS:
        return None
    return int(edges[0]), int(edges[1]) + 1


def jump_turn(rng: random.Random) -> Gesture:
    side, pace = rng.choice(SIDES), rng.uniform(0.88, 1.12)
    sign = 1.0 if side == LEFT else -1.0
    form, limits = rng.choice(
        (("jump-quarter", (92, 110)), ("jump-half", (165, 195)), ("jump-half", (165, 195)), ("jump-full", (345, 370)))
    )
    degrees, wound = rng.uniform(*limits), rng.uniform(5, 18)

    def base(part: Part) -> Array | None:
        joints = with_bones(resample_points(part.joints.astype(np.float64), FPS * pace, FPS))
        flight, had = _flight(joints), sign * _turned(joints)
        if flight is None or had < -12 or (degrees - had) / (flight[1] - flight[0]) * FPS > _FASTEST:
            return None
        return _in_the_air(joints, flight, sign * np.radians(degrees - max(had, 0.0)), np.radians(wound))

    return Gesture(
        0.0, ("jump-turn", form), lambda body: None, side, base=base, untrue="" if form == "jump-half" else "180"
    )


def _in_the_air(joints: Array, flight: tuple[int, int], turn: float, wound: float) -> Array:
    """Turn a body (T, 22, 3) by radians while it flies; the shoulders wind up by `wound` before."""
    first, last = flight
    t = np.arange(len(joints), dtype=np.float64)
    feet = _through(t, first, last) * turn
    more = _FACES * FPS
    hips = _through(t, first - more, last + more) * turn
    winds = eased((t - first + 14) / 9) * (1 - eased((t - first + 5) / 8)) * wound * np.sign(turn)
    shoulders = _through(t, first - 1.5 * more, last + 0.5 * more) * turn - winds
    pivot = joints[np.minimum(np.arange(len(joints)), last), :1] * LEVEL
    moved = pivot + about_vertical(joints - pivot, np.repeat(feet[:, None], 22, axis=1))
    turned = np.repeat(feet[:, None], 2, axis=1)
    return posed(joints, moved[:, 0], spine_yaw(hips, shoulders), moved[:, _TOES], turned)


def _through(t: Array, first: float, last: float) -> Array:
    x = np.clip((t - first) / (last - first), 0.0, 1.0)
    return 0.5 * eased(x) + 0.5 * x
