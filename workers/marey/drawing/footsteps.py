"""Steps of a standing body on the spot, to a side, ahead and over stairs.

Only the footsteps are drawn. The body is over the middle of both feet and faces between them, smoothed; it leans its
weight to the foot that stands, and the shoulders look ahead.
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from marey.checks.kinematics import heading
from marey.drawing.gesture import SIDES
from marey.drawing.placed import about_vertical, posed, spine_yaw
from marey.motion.filters import smooth_above, smooth_seconds
from marey.motion.rotations import from_rotvec, rotate
from marey.posing.limbs import FPS, LEG_CHAINS, LEVEL
from marey.posing.standing import ARMS, SIGN, StandingBody, eased

Array = NDArray[np.floating]

_TOES = [10, 11]
_SMOOTH = 0.13  # seconds over which the body follows its feet
_REACH = 0.99  # of the length of a leg


@dataclass(frozen=True)
class Footstep:
    """A step: foot 0 (left) or 1, its start and duration in seconds, and where the foot goes.

    Attributes:
        left, up, forward, degrees: place and direction of the foot relative to where it stood in the idle.
    """

    foot: int
    start: float
    seconds: float
    left: float = 0.0
    up: float = 0.0
    forward: float = 0.0
    degrees: float = 0.0


@dataclass(frozen=True)
class Manner:
    """How steps are made.

    Attributes:
        lift: metres of the toes over the floor.
        heel: degrees by which the heel rises first.
        sway: metres that the hips move over the standing foot.
        look: seconds by which the shoulders are ahead of the hips.
        peak: share of a step at which the foot is highest.
        throw: metres by which it is further ahead there.
    """

    lift: float
    heel: float
    sway: float
    look: float
    peak: float = 0.5
    throw: float = 0.0

    @classmethod
    def draw(cls, rng: random.Random) -> Manner:
        return cls(rng.uniform(0.03, 0.08), rng.uniform(15, 38), rng.uniform(0.015, 0.04), rng.uniform(0.04, 0.16))


def stepped(joints: Array, steps: Sequence[Footstep], manner: Manner, follows: float = _SMOOTH) -> Array:
    """Let an idle (T, 22, 3) step; return joints that begin at the origin and face +Z.

    Args:
        joints: the idle, metres.
        steps: in their order.
        manner: how they are made.
        follows: seconds over which the body follows its feet.
    """
    angle = np.radians(heading(joints, FPS)[0])
    local = about_vertical(joints - joints[0, 0] * LEVEL, np.full(joints.shape[:2], -angle))
    frames = np.arange(len(local))
    places, lifted, swings = np.zeros((len(local), 2, 4)), np.zeros((len(local), 2)), np.zeros((len(local), 2))
    for step in steps:
        share = np.clip((frames / FPS - step.start) / step.seconds, 0.0, 1.0)
        went = _went(share, step.up - places[-1, step.foot, 1])
        target = np.array([step.left, step.up, step.forward, np.radians(step.degrees)])
        places[:, step.foot] += went * (target - places[-1, step.foot])
        lifted[:, step.foot] += np.sin(np.pi * _risen(np.clip((share - 0.08) / 0.92, 0, 1), manner.peak)) ** 2
        swings[:, step.foot] += np.sin(np.pi * share**0.6) ** 2
    body = smooth_seconds(places.mean(1), follows, FPS)
    for side, (_, _, ankle, toe) in enumerate(LEG_CHAINS):
        pitch = np.zeros((len(local), 3))
        pitch[:, 0] = np.radians(manner.heel) * swings[:, side]
        local[:, toe] = local[:, ankle] + rotate(from_rotvec(pitch), local[:, toe] - local[:, ankle])
    feet = about_vertical(joints[:, _TOES] - joints[0, 0] * LEVEL, np.full((len(local), 2), -angle))
    toes = about_vertical(feet, places[..., 3]) + places[..., :3]
    toes[..., 1] += manner.lift * lifted
    toes += about_vertical(np.array([0.0, 0.0, manner.throw]) * lifted[..., None], places[..., 3])
    weight = smooth_seconds((lifted[:, 1] - lifted[:, 0]) * manner.sway, 0.1, FPS)
    dip = smooth_seconds(lifted.max(1) * 0.25 * manner.sway, 0.1, FPS)
    root = about_vertical(local[:, 0] + np.stack([weight, -dip, 0 * dip], axis=-1), body[:, 3]) + body[:, :3]
    shoulders = np.interp(frames + manner.look * FPS, frames, body[:, 3])
    yaw = spine_yaw(body[:, 3], shoulders)
    root[:, 1] -= _too_high(local, root, yaw[:, 0], toes, places[..., 3])
    return posed(local, root, yaw, toes, places[..., 3])


def _risen(share: Array, peak: float) -> Array:
    """Shares (T,) of a step, bent so that its middle is at `peak`."""
    return np.interp(share, [0.0, peak, 1.0], [0.0, 0.5, 1.0])


def _went(share: Array, rise: float) -> Array:
    """Progress (T, 4) of a step to the left, up, forward and round: up early onto a stair, down late."""
    went = np.repeat(eased(np.clip((share - 0.08) / 0.92, 0.0, 1.0))[:, None], 4, axis=1)
    if rise:
        went[:, 1] = eased(share / 0.7) if rise > 0 else eased((share - 0.3) / 0.7)
    return went


def _too_high(local: Array, root: Array, yaw: Array, toes: Array, toe_yaw: Array) -> Array:
    """Metres (T,) by which hips at `root` are too high for the legs to reach the feet; see `posed`."""
    over = np.zeros((len(root), 2))
    for side, (hip, knee, ankle, toe) in enumerate(LEG_CHAINS):
        bones = np.linalg.norm(local[0, [knee, ankle]] - local[0, [hip, knee]], axis=-1).sum()
        at = root + about_vertical(local[:, hip] - local[:, 0], yaw)
        down = toes[:, side] - about_vertical(local[:, toe] - local[:, ankle], toe_yaw[:, side]) - at
        level = np.minimum(np.linalg.norm(down * LEVEL, axis=-1), 0.9 * bones)
        over[:, side] = -down[:, 1] - np.sqrt((_REACH * bones) ** 2 - level**2)
    return smooth_above(np.maximum(over.max(1), 0.0), 2.0)


def swing_arms_with(body: StandingBody, steps: Sequence[Footstep], degrees: float) -> None:
    """Swing each arm ahead with the steps of the other foot: it is furthest where the foot comes down, and hangs again
    after the last step."""
    time = np.arange(len(body.joints)) / FPS
    phase = np.zeros(len(time))
    for number, step in enumerate(steps):
        target = SIGN[SIDES[step.foot]] if number < len(steps) - 1 else 0.0
        phase += eased(np.clip((time - step.start) / step.seconds, 0.0, 1.0)) * (target - phase[-1])
    phase = smooth_seconds(phase, 0.1, FPS)
    for side in SIDES:
        _, shoulder, elbow, _ = ARMS[side]
        swung = SIGN[side] * degrees * phase
        body.turn(shoulder, "left", swung)
        body.turn(elbow, "left", -0.5 * np.maximum(-swung, 0.0) - 0.15 * degrees * np.abs(phase))
