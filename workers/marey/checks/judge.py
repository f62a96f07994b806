"""Kinematic judge: check on joints (T, 22, 3) and frames per second alone that a motion does what its prompt says.

Thresholds were set on the training clips of the Bandai-Namco sets; the checker's own rate on their test clips, and how
often it passes clips of other actions, are reported by `rates.py` beside every number that it gives on generated
motion.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from marey.checks.kinematics import ANKLES, HEAD, PELVIS, WRISTS, Array, variety
from marey.checks.stretch import Arm, Stretch
from marey.checks.strikes import is_lively, kicks, punches, slashes
from marey.motion.filters import smooth_seconds

Act = Literal["walk", "run", "walk_back", "turn", "wave", "raise", "bow", "kick", "punch", "slash", "dance"]
Side = Literal["", "left", "right", "both"]

_LEAST_PART = 0.8  # seconds that each action of a sequence needs
_SPLIT_STEP = 0.2  # seconds between the moments at which a sequence is tried to be split


@dataclass(frozen=True)
class Expectation:
    """One action that a prompt asks for.

    Attributes:
        act: name of the action.
        side: for turns left or right; for hands left, right or both.
        straight: the way must be straight (for walking, running and walking backward).
    """

    act: Act
    side: Side = ""
    straight: bool = False


@dataclass(frozen=True)
class CheckVerdict:
    """Verdict on a motion, with the reason of a failure."""

    passed: bool
    reason: str = ""


# -- single actions ---------------------------------------------------------------------------------------------------


def _travels(m: Stretch, want: Expectation, *, run: bool) -> str:
    body = m.gait
    needed = max(0.5, (0.5 if run else 0.25) * m.seconds)
    if body.along < needed:
        return f"goes {body.along:.1f} m forward in {m.seconds:.1f} s"
    if np.mean(m.along > 0.2) < 0.6:
        return "stands for much of the time"
    if abs(body.turn) > 45:
        return f"turns by {body.turn:.0f} degrees"
    if m.running != run:
        return "runs" if m.running else "walks, does not run"
    return _drifts(m) if want.straight else ""


def _drifts(m: Stretch) -> str:
    way = straightness(m.joints, m.fps)
    return f"drifts {way.deviation:.2f} m off a straight way of {way.length:.1f} m" if not way.straight else ""


def _walk(m: Stretch, want: Expectation) -> str:
    return _travels(m, want, run=False)


def _run(m: Stretch, want: Expectation) -> str:
    return _travels(m, want, run=True)


def _walk_back(m: Stretch, want: Expectation) -> str:
    if m.gait.along > -max(0.5, 0.2 * m.seconds):
        return f"goes {-m.gait.along:.1f} m backward in {m.seconds:.1f} s"
    if np.mean(m.along < -0.12) < 0.6:
        return "does not go backward for much of the time"
    if abs(m.gait.turn) > 60:
        return f"turns by {m.gait.turn:.0f} degrees"
    return _drifts(m) if want.straight else ""


def _turn(m: Stretch, want: Expectation) -> str:
    angle = m.gait.turn if want.side == "left" else -m.gait.turn
    if angle < 45:
        return f"turns {angle:.0f} degrees to the {want.side}"
    if angle > 200:
        return f"turns {angle:.0f} degrees: more than a turn"
    return "" if m.gait.path > 0.6 and m.gait.along > 0.4 else f"turns on the spot ({m.gait.path:.1f} m)"


def _arms(m: Stretch, side: Side) -> tuple[list[Arm], list[Arm]]:
    """Return the requested arms, and the others."""
    named = list(zip(m.arms, ("left", "right"), strict=True))
    return [a for a, name in named if side in (name, "both")], [a for a, name in named if side not in (name, "both")]


def _side_up(m: Stretch, side: Side) -> str:
    wanted, others = _arms(m, side)
    if not side:
        return "" if any(a.up for a in m.arms) else "no hand is lifted"
    if not all(a.up for a in wanted):
        return f"the {side} hand is not lifted" if side != "both" else "not both hands are lifted"
    if any(a.up and not a.down and a.rise > 0.6 * max(w.rise for w in wanted) for a in others):
        return "the other hand is lifted too"
    return ""


def _wave(m: Stretch, want: Expectation) -> str:
    if problem := _side_up(m, want.side):
        return problem
    wanted, others = _arms(m, want.side)
    if m.gait.path > 0.3 * m.seconds + 0.4 and max(a.peak for a in wanted or others) < 0.15:
        return "swings the arms while walking"
    if not any(a.waves for a in wanted or others):
        return f"the hand is lifted, but swings {max((a.swings for a in wanted or others), default=0)} times"
    return ""


def _raise(m: Stretch, want: Expectation) -> str:
    if problem := _side_up(m, want.side):
        return problem
    wanted, others = _arms(m, want.side)
    if any(a.swings >= 6 for a in (wanted or others)):
        return "waves"
    return f"walks {m.gait.path:.1f} m meanwhile" if m.gait.path > 0.3 * m.seconds + 0.5 else ""


def _bow(m: Stretch, want: Expectation) -> str:
    if m.bend < 14:
        return f"leans forward by {m.bend:.0f} degrees"
    if m.gait.path > 0.2 * m.seconds + 0.4:
        return f"walks {m.gait.path:.1f} m meanwhile"
    head = smooth_seconds(m.joints[:, HEAD, 1], 0.1, m.fps)
    return "" if np.percentile(head, 95) - head.min() > 0.05 else "the head does not go down"


def _kick(m: Stretch, want: Expectation) -> str:
    return "" if kicks(m.joints, m.fps) else "no foot comes near the height of the hips"


def _punch(m: Stretch, want: Expectation) -> str:
    if m.gait.path > 0.5 * m.seconds + 0.5:
        return f"travels {m.gait.path:.1f} m"
    return "" if punches(m.joints, m.fps) else "no fist shoots forward"


def _slash(m: Stretch, want: Expectation) -> str:
    return "" if slashes(m.joints, m.fps) else "the hands do not cut down together from over the head"


def _dance(m: Stretch, want: Expectation) -> str:
    if not is_lively(m.joints, m.fps):
        return "moves little"
    direct = float(np.linalg.norm((m.joints[-1, PELVIS] - m.joints[0, PELVIS])[[0, 2]])) / m.seconds
    if direct > 0.7:
        return f"travels ahead at {direct:.1f} m/s"
    if variety(m.joints, m.heading, ANKLES) < 0.12:
        return "the legs hardly move"
    return "" if variety(m.joints, m.heading, WRISTS) > 0.2 else "the arms hardly move"


_CHECKS: dict[str, Callable[[Stretch, Expectation], str]] = {
    "walk": _walk,
    "run": _run,
    "walk_back": _walk_back,
    "turn": _turn,
    "wave": _wave,
    "raise": _raise,
    "bow": _bow,
    "kick": _kick,
    "punch": _punch,
    "slash": _slash,
    "dance": _dance,
}
"""Check of each action: returns why a stretch does not show it; an empty text = it does."""


# -- motions -------------------------------------------------------------------------------------------------------


def judge(joints: Array, fps: float, expected: Sequence[Expectation]) -> CheckVerdict:
    """Judge a motion against its expected actions, in that order.

    Args:
        joints: (T, 22, 3) metres, Y up, anywhere and facing anywhere.
        fps: frames a second.
        expected: one action, or several in their order.
    """
    motion = Stretch(joints, fps)
    if len(expected) == 1:
        reason = _CHECKS[expected[0].act](motion, expected[0])
        return CheckVerdict(not reason, reason)
    reason = _in_order(motion, list(expected))
    return CheckVerdict(not reason, reason)


def _in_order(motion: Stretch, expected: list[Expectation]) -> str:
    """Find moments that split the motion so that each part does its own action and not yet the next one."""
    step, least = round(_SPLIT_STEP * motion.fps), round(_LEAST_PART * motion.fps)
    frames = len(motion.joints)
    rest = (len(expected) - 1) * least
    first, second = expected[0], expected[1]
    reason = "too short for its acts"
    for at in range(least, frames - rest + 1, step):
        before = motion.part(0, at)
        reason_before = _CHECKS[first.act](before, first)
        if reason_before:
            reason = reason if reason.startswith("then") else f"first ({first.act}): {reason_before}"
            continue
        if (first.act, first.side) != (second.act, second.side) and not _CHECKS[second.act](before, second):
            reason = f"then: the {second.act} comes before or together with the {first.act}"
            continue
        after = motion.part(at, frames)
        if _hand_is_up_already(before, first, after, second):
            reason = f"then: the hand is up before or together with the {first.act}"
            continue
        last = len(expected) == 2
        reason_after = _CHECKS[second.act](after, second) if last else _in_order(after, expected[1:])
        if not reason_after:
            return ""
        reason = f"then ({second.act}): {reason_after}"
    return reason


def _hand_is_up_already(before: Stretch, first: Expectation, after: Stretch, second: Expectation) -> bool:
    """Return True if the hand of a wave or a raise is up for half of the time before it: then both happen together."""
    hands = ("wave", "raise")
    if second.act not in hands or first.act in hands:
        return False
    wanted = [k for k, name in enumerate(("left", "right")) if second.side in (name, "both", "")]
    shares = [np.mean(before.over(k) > after.over(k).max() - 0.25) for k in wanted]
    return bool(min(shares) >= 0.5)


@dataclass(frozen=True)
class Straightness:
    """Straightness of a path: length and largest distance from the line between its ends, metres."""

    length: float
    deviation: float

    @property
    def straight(self) -> bool:
        """Real straight walks sway by a step's width and are up to 8 % off."""
        return self.deviation < 0.12 + 0.08 * self.length


def straightness(joints: Array, fps: float) -> Straightness:
    """Measure the path of the pelvis over the floor, without its sway."""
    way = smooth_seconds(np.asarray(joints, np.float64)[:, PELVIS], 0.4, fps)[:, [0, 2]]
    chord = way[-1] - way[0]
    length = float(np.linalg.norm(chord))
    if length < 1e-6:
        return Straightness(0.0, 0.0)
    offset = way - way[0]
    return Straightness(length, float(np.abs(offset[:, 0] * chord[1] - offset[:, 1] * chord[0]).max() / length))
