"""Measures of what a prompt says about an action: side, number, direction and speed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Literal

import numpy as np

from marey.referee.aerial import flights
from marey.referee.body import HIPS, SIDES, Body, swings
from marey.referee.gaits import gait
from marey.referee.gestures import claps

Direction = Literal["forward", "backward", "left", "right", ""]
NAMES: Mapping[str, Direction] = {"L": "left", "R": "right"}
BUSIER = 1.3
"""How many times as fast one arm has to move as the other to be the arm that acts."""
HIGHER = 0.1
"""How much higher one foot has to be lifted than the other to be the foot that acts, m."""
LEAST_TRAVEL = 0.25
"""Shortest distance that counts as travel, m."""
LEAST_TURN = 30.0
"""Smallest angle that counts as a turn, degrees."""
PEAK_S = 0.1
"""Window of the running mean before a peak of speed is taken."""


def acting_side(action: str, body: Body) -> Direction:
    """Return the side of the limb that acts: the foot that is lifted higher in a kick, else the faster arm."""
    if action == "kick":
        lifts = {side: float(body.lift(side).max()) for side in SIDES}
        first, second = sorted(SIDES, key=lambda side: -lifts[side])
        return NAMES[first] if lifts[first] - lifts[second] >= HIGHER else ""
    speeds = {
        side: float(np.percentile(np.linalg.norm(body.own_velocity(f"{side}_wrist", "neck"), axis=-1), 90))
        for side in SIDES
    }
    first, second = sorted(SIDES, key=lambda side: -speeds[side])
    return NAMES[first] if speeds[first] >= BUSIER * speeds[second] else ""


def repetitions(action: str, body: Body) -> int:
    """Count how often an action is done.

    Args:
        action: a key of `COUNTS`.
    """
    return int(COUNTS[action](body))


def direction(action: str, body: Body) -> Direction:
    """Return where a body goes, as seen by itself, at the point farthest from where it began; of `turn` the turn."""
    if action == "turn":
        yaw = body.smooth(body.yaw, PEAK_S)
        turned = float(yaw[-1] - yaw[0])
        return "" if abs(turned) < LEAST_TURN else "left" if turned > 0 else "right"
    velocity = body.velocity("pelvis")
    ahead = np.cumsum((velocity * body.forward).sum(-1)) / body.fps
    aside = np.cumsum((velocity * body.left).sum(-1)) / body.fps
    farthest = int(np.argmax(np.hypot(ahead, aside)))
    forward, left = float(ahead[farthest]), float(aside[farthest])
    if np.hypot(forward, left) < LEAST_TRAVEL:
        return ""
    if abs(forward) >= abs(left):
        return "forward" if forward > 0 else "backward"
    return "left" if left > 0 else "right"


def pace(action: str, body: Body) -> float:
    """Return how fast an action is done: m/s, of a turn degrees a second.

    Of gaits the mean speed of the hips, of other actions the highest speed of a joint that acts.

    Args:
        action: `walk`, `run`, `turn-around`, or a key of `ACTING`.
    """
    if action in ("walk", "run"):
        return gait(body).speed
    if action == "turn-around":
        return float(np.abs(np.gradient(body.smooth(body.yaw, PEAK_S))).max()) * body.fps
    return max(float(body.speed(joint, PEAK_S).max()) for joint in ACTING[action])


def _jumps(body: Body) -> int:
    return sum(flight.height >= 0.06 for flight in flights(body))


def _bows(body: Body) -> int:
    tip = body.smooth(body.tip, 0.1)
    return sum(tip[end] - tip[begin] >= 15 for begin, end in swings(tip, 12.0))


def _squats(body: Body) -> int:
    hips = body.smooth(body.height("pelvis"), 0.1)
    return sum(hips[begin] - hips[end] >= 0.22 * HIPS for begin, end in swings(hips, 0.22 * HIPS))


def _raised_arms(body: Body) -> int:
    """Count how often a hand is raised; of two hands that are raised at once, one."""
    heights = [body.smooth(body.height(f"{side}_wrist") - body.height(f"{side}_shoulder"), 0.1) for side in SIDES]
    return max(
        sum(height[end] > height[begin] and height[end] > -0.1 for begin, end in swings(height, 0.3))
        for height in heights
    )


def _kicks(body: Body) -> int:
    """Count how often a foot rises from the floor to the height of a knee and over it."""
    found = 0
    for side in SIDES:
        foot = body.smooth(np.maximum(body.height(f"{side}_ankle"), body.height(f"{side}_foot")), 0.1)
        found += sum(foot[end] > foot[begin] and foot[end] >= 0.45 for begin, end in swings(foot, 0.25))
    return found


def _punches(body: Body) -> int:
    """Count how often a fist is stretched out ahead at 2 m/s or more."""
    found = 0
    for side in SIDES:
        reach = np.linalg.norm(body.own(f"{side}_wrist", f"{side}_shoulder"), axis=-1)
        speed = np.linalg.norm(body.own_velocity(f"{side}_wrist", window=0.06), axis=-1)
        ahead = body.own(f"{side}_wrist", "neck")[:, 2]
        found += sum(
            reach[end] > reach[begin] and speed[begin : end + 1].max() >= 2 and ahead[end] > 0.25
            for begin, end in swings(reach, 0.12)
        )
    return found


COUNTS: Mapping[str, Callable[[Body], int]] = {
    "jump": _jumps,
    "bow": _bows,
    "squat": _squats,
    "kick": _kicks,
    "punch": _punches,
    "clap": claps,
    "raise-arm": _raised_arms,
    "step": lambda body: gait(body).steps,
}
_WRISTS = ("L_wrist", "R_wrist")
ACTING: Mapping[str, tuple[str, ...]] = {
    "wave": _WRISTS,
    "raise-arm": _WRISTS,
    "punch": _WRISTS,
    "clap": _WRISTS,
    "kick": ("L_ankle", "R_ankle"),
    "bow": ("head",),
    "squat": ("pelvis",),
    "sit-down": ("pelvis",),
}
"""Joints whose speed is the speed of an action."""
