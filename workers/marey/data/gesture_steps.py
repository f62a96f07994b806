"""Steps of a captured idle on the spot and to the side: turns on the spot, spins on small steps, sidesteps.

Only the footsteps are drawn. The body is over the middle of both feet and faces between them, smoothed; it leans its
weight to the foot that stands, and the shoulders look ahead.
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from marey.checks.kinematics import heading, smooth
from marey.data.gesture_ways import about_vertical, posed, spine_yaw
from marey.data.part import FPS
from marey.drawing.gesture import SIDES, Gesture
from marey.motion.filters import smooth_above
from marey.motion.rotations import from_rotvec, rotate
from marey.posing.limbs import LEG_CHAINS, LEVEL
from marey.posing.standing import ARMS, LEFT, StandingBody, eased

Array = NDArray[np.floating]

_TOES = [10, 11]
_SMOOTH = 0.13  # seconds over which the body follows its feet
_TURN_PACES = {"quick": (0.26, 0.34), "": (0.36, 0.52), "slow": (0.6, 0.85)}  # seconds from one step to the next
_UNTRUE = {
    "around-half": r"\b90\b|quarter",
    "around-quarter": r"180|about.?face|about turn|other way|behind|back|half|u-turn",
    "around-more": r"180|90|about.?face|about turn|other way|half|quarter|u-turn",
}
"""Patterns of words that are true of other turns on the spot."""
_SIDE_PACES = {"quick": (0.24, 0.32), "": (0.36, 0.5), "slow": (0.58, 0.8)}
_LENGTHS = {"quick": (0.28, 0.5), "": (0.2, 0.42), "slow": (0.2, 0.4)}  # metres of a sidestep
_REACH = 0.99  # of the length of a leg
_SWING = 0.92  # of the time to the next step
_LARGEST_PART = 95.0  # degrees that a foot turns in one step


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
    """

    lift: float
    heel: float
    sway: float
    look: float

    @classmethod
    def draw(cls, rng: random.Random) -> Manner:
        return cls(rng.uniform(0.03, 0.08), rng.uniform(15, 38), rng.uniform(0.015, 0.04), rng.uniform(0.04, 0.16))


def stepped(joints: Array, steps: Sequence[Footstep], manner: Manner) -> Array:
    """Let an idle (T, 22, 3) step; return joints that begin at the origin and face +Z."""
    angle = np.radians(heading(joints, FPS)[0])
    local = about_vertical(joints - joints[0, 0] * LEVEL, np.full(joints.shape[:2], -angle))
    frames = np.arange(len(local))
    places, lifted, swings = np.zeros((len(local), 2, 4)), np.zeros((len(local), 2)), np.zeros((len(local), 2))
    for step in steps:
        share = np.clip((frames / FPS - step.start) / step.seconds, 0.0, 1.0)
        went = _went(share, step.up - places[-1, step.foot, 1])
        target = np.array([step.left, step.up, step.forward, np.radians(step.degrees)])
        places[:, step.foot] += went * (target - places[-1, step.foot])
        lifted[:, step.foot] += np.sin(np.pi * np.clip((share - 0.08) / 0.92, 0, 1)) ** 2
        swings[:, step.foot] += np.sin(np.pi * share**0.6) ** 2
    body = smooth(places.mean(1), _SMOOTH, FPS)
    for side, (_, _, ankle, toe) in enumerate(LEG_CHAINS):
        pitch = np.zeros((len(local), 3))
        pitch[:, 0] = np.radians(manner.heel) * swings[:, side]
        local[:, toe] = local[:, ankle] + rotate(from_rotvec(pitch), local[:, toe] - local[:, ankle])
    feet = about_vertical(joints[:, _TOES] - joints[0, 0] * LEVEL, np.full((len(local), 2), -angle))
    toes = about_vertical(feet, places[..., 3]) + places[..., :3]
    toes[..., 1] += manner.lift * lifted
    weight = smooth((lifted[:, 1] - lifted[:, 0]) * manner.sway, 0.1, FPS)
    dip = smooth(lifted.max(1) * 0.25 * manner.sway, 0.1, FPS)
    root = about_vertical(local[:, 0] + np.stack([weight, -dip, 0 * dip], axis=-1), body[:, 3]) + body[:, :3]
    shoulders = np.interp(frames + manner.look * FPS, frames, body[:, 3])
    yaw = spine_yaw(body[:, 3], shoulders)
    root[:, 1] -= _too_high(local, root, yaw[:, 0], toes, places[..., 3])
    return posed(local, root, yaw, toes, places[..., 3])


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


def turn_around(rng: random.Random) -> Gesture:
    side = rng.choice(SIDES)
    form, limits = rng.choices(
        (("around-half", (165, 195)), ("around-quarter", (75, 105)), ("around-more", (105, 165))), (5, 3, 2)
    )[0]
    pace = rng.choices(list(_TURN_PACES), (1, 3, 1))[0]
    steps, end = _turning(rng, side, rng.uniform(*limits), rng.uniform(*_TURN_PACES[pace]))
    kinds = ("around", form, *([f"around-{pace}"] if pace else []))
    return replace(_stepping(rng, steps, end, kinds, side), untrue=_UNTRUE[form])


def small_step_spin(rng: random.Random) -> Gesture:
    """A spin on small steps, 300 degrees or more in one go."""
    side, turns = rng.choice(SIDES), rng.choice((1, 1, 1, 2))
    steps, end = _turning(rng, side, 360.0 * turns, rng.uniform(0.2, 0.27))
    made = _stepping(rng, steps, end, ("spin", "spin-steps", "spin-twice" if turns == 2 else "spin-once"), side)
    return replace(made, untrue="pirouette")


def _turning(rng: random.Random, side: str, degrees: float, interval: float) -> tuple[list[Footstep], float]:
    """Steps of a turn and their end in seconds: the inner foot opens, the outer one closes."""
    sign, inner = (1.0, 0) if side == LEFT else (-1.0, 1)
    pairs = -(-int(degrees) // int(rng.uniform(0.75, 1.0) * _LARGEST_PART))
    closer = rng.uniform(0.0, 0.2)
    start, steps = rng.uniform(0.2, 1.0), list[Footstep]()
    for pair in range(1, pairs + 1):
        for foot in (inner, 1 - inner):
            past = 0.0 if foot == inner or pair == pairs else closer
            steps.append(
                Footstep(foot, start, _SWING * interval, degrees=sign * min((pair + past) * degrees / pairs, degrees))
            )
            start += interval
    return steps, start


def sidestep(rng: random.Random) -> Gesture:
    side = rng.choice(SIDES)
    pace = rng.choices(list(_SIDE_PACES), (1, 3, 1))[0]
    low = rng.random() < 0.25
    goes_on = rng.random() < 0.4  # steps from the first frame to the last
    interval, length = rng.uniform(*_SIDE_PACES[pace]), rng.uniform(*_LENGTHS[pace])
    pairs = max(rng.randint(2, 7), 1 + int(0.6 / length)) + goes_on
    sign, lead = (1.0, 0) if side == LEFT else (-1.0, 1)
    start, steps = -rng.uniform(0.2, 1.0) * interval if goes_on else rng.uniform(0.15, 0.9), list[Footstep]()
    for pair in range(1, pairs + 1):
        for foot in (lead, 1 - lead):
            steps.append(Footstep(foot, start, _SWING * interval, left=sign * pair * length))
            start += interval
    kinds = ("sidestep", *([f"sidestep-{pace}"] if pace else []), *(["sidestep-low"] if low else []))
    made = _stepping(rng, steps, start, kinds, side, low=rng.uniform(0.08, 0.16) if low else 0.0)
    return replace(made, seconds=start - rng.uniform(0.5, 1.0) * interval) if goes_on else made


def _stepping(
    rng: random.Random, steps: Sequence[Footstep], end: float, kinds: tuple[str, ...], side: str, *, low: float = 0.0
) -> Gesture:
    """Steps of an idle, with the hands before the body and the hips `low` metres lower in a guarded one."""
    manner, stoop, shrug = Manner.draw(rng), rng.uniform(-3, 4), rng.uniform(-1, 6)
    point = np.array([rng.uniform(0.05, 0.15), rng.uniform(-0.28, -0.1), rng.uniform(0.26, 0.36)])

    def change(body: StandingBody) -> None:
        t = np.arange(len(body.joints)) / FPS
        moving = eased((t - steps[0].start + 0.25) / 0.4) * (1 - eased((t - end - 0.1) / 0.5))
        body.lean(stoop * moving, "left")
        for one, sign in zip(SIDES, (1.0, -1.0), strict=True):
            body.turn(ARMS[one][1], "forward", -sign * shrug * moving)
        if low:
            body.shift(-low * moving, -0.3 * low * moving)
            body.lean(18.0 * moving, "left")
            for one in SIDES:
                body.hold(one, moving, point)
        body.joints[:] = stepped(body.joints, steps, manner)

    return Gesture(end + rng.uniform(0.3, 1.2), kinds, change, side)
