"""Bars of a loop, measured on several cycles played one after another."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise

import numpy as np

from marey.motion.clip import MotionClip
from marey.motion.edits.loop_blend import Bool, Closed
from marey.motion.edits.loop_search import PERCENTILE, standing_spans, stands
from marey.motion.feet import find_contacts, skate
from marey.motion.kinematics import forward_kinematics
from marey.motion.rotations import Array

PLAYED = 3
"""Cycles."""
SKATE = 1.1
"""Skating of a loop over that of its source."""
SLACK = 0.002
"""Metres a second that standing feet may skate more: a source whose feet are locked skates by rounding alone."""
ROUNDING = 1e-5
"""Metres."""


@dataclass(frozen=True)
class Fault:
    """A bar that a loop misses.

    Attributes:
        excess: measure over bar; above 1.
        reason: for users.
    """

    excess: float
    reason: str


@dataclass(frozen=True, eq=False)
class Steps:
    """Steps of joints from frame to frame, and their changes, metres.

    Attributes:
        joints: (T, J, 3).
    """

    joints: Array = field(repr=False)

    @cached_property
    def step(self) -> Array:
        """(T - 1, J): from frame t to t + 1."""
        return np.linalg.norm(np.diff(self.joints, axis=0), axis=-1)

    @cached_property
    def change(self) -> Array:
        """(T - 2, J): of the step to frame t + 1 to the next."""
        return np.linalg.norm(np.diff(self.joints, n=2, axis=0), axis=-1)

    def usual(self) -> tuple[Array, Array]:
        """Return the percentile of both for each joint (J,)."""
        return np.percentile(self.step, PERCENTILE, axis=0), np.percentile(self.change, PERCENTILE, axis=0)


@dataclass(frozen=True, eq=False)
class Played:
    """Cycles of a loop, one after another.

    Attributes:
        joints: (T, J, 3) metres.
        seams: frames at which a cycle ends and the next begins.
        contacts: (T, 4), found in the joints.
    """

    joints: Array = field(repr=False)
    seams: tuple[int, ...]
    contacts: Bool = field(repr=False)


def played(clip: MotionClip, loop: Closed, cycles: int = PLAYED) -> Played:
    """Play a loop of a clip."""
    joints = forward_kinematics(clip.skeleton, loop.rotations, loop.root)
    parts, count = [joints], len(joints) - 1
    for _ in range(cycles - 1):
        joints = loop.travel.places(joints)
        parts.append(joints[1:])
    whole = np.concatenate(parts)
    seams = tuple(count * number for number in range(1, cycles))
    return Played(whole, seams, find_contacts(whole, clip.skeleton, clip.fps))


def fault_of(clip: MotionClip, loop: Closed, window: int) -> Fault | None:
    """Return the bar that a loop misses by most, None if it keeps all of them."""
    source = clip.joints.astype(np.float64)
    play = played(clip, loop)
    names = clip.skeleton.joint_names
    faults = [*_jumps(Steps(source), play, names), *_double_stands(play, window), *_skating(clip, source, play)]
    return max(faults, key=lambda fault: fault.excess, default=None)


def _jumps(source: Steps, play: Played, names: tuple[str, ...]) -> list[Fault]:
    """Return the joints whose step, or change of step, at a seam is larger than usual in the source."""
    usual, steps = source.usual(), Steps(play.joints)
    seams = np.array(play.seams)
    at = {
        "moves": (np.maximum(steps.step[seams - 1], steps.step[seams]).max(axis=0), usual[0]),
        "changes its step by": (steps.change[seams - 1].max(axis=0), usual[1]),
    }
    faults: list[Fault] = []
    for verb, (found, allowed) in at.items():
        joint = int((found / (allowed + ROUNDING)).argmax())
        if found[joint] > allowed[joint] + ROUNDING:
            reason = (
                f"{names[joint]} {verb} {1000 * found[joint]:.1f} mm at the seam, {1000 * allowed[joint]:.1f} allowed"
            )
            faults.append(Fault(float(found[joint] / (allowed[joint] + ROUNDING)), reason))
    return faults


def _double_stands(play: Played, window: int) -> list[Fault]:
    """Return the seams at which a foot leaves the floor and stands again before the other foot has stood."""
    spans = standing_spans(stands(play.contacts))
    for (_, end, foot), (begin, _, next_foot) in pairwise(spans):
        if foot == next_foot and any(end - 1 <= seam + window and begin >= seam - window for seam in play.seams):
            return [Fault(2.0, f"the {('left', 'right')[foot]} foot stands twice in a row at the seam")]
    return []


def _skating(clip: MotionClip, source: Array, play: Played) -> list[Fault]:
    tree = clip.skeleton
    usual = skate(source, find_contacts(source, tree, clip.fps), tree, clip.fps)
    found = skate(play.joints, play.contacts, tree, clip.fps)
    allowed = SKATE * usual + SLACK
    if found <= allowed:
        return []
    return [Fault(found / allowed, f"standing feet slide at {1000 * found:.1f} mm/s, {1000 * allowed:.1f} allowed")]
