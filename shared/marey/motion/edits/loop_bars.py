"""Bars of a loop, measured on several cycles played one after another."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from marey.motion.clip import MotionClip
from marey.motion.edits.loop_blend import Bool, Closed
from marey.motion.edits.loop_feet import standing_spans, supports
from marey.motion.edits.loop_search import PERCENTILE
from marey.motion.feet import find_contacts, skate
from marey.motion.kinematics import forward_kinematics
from marey.motion.rotations import Array

PLAYED = 3
"""Cycles."""
SKATE = 1.1
"""Skating of a loop over that of its source."""
SLACK = 0.002
"""Metres a second that standing feet may skate more: a source whose feet are locked skates by rounding alone."""
ROUNDING = 1e-4
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
class Played:
    """Cycles of a loop, one after another.

    Attributes:
        joints: (T, J, 3) metres.
        seams: frames at which a cycle ends and the next begins.
    """

    joints: Array = field(repr=False)
    seams: tuple[int, ...]


def played(clip: MotionClip, loop: Closed, cycles: int = PLAYED) -> Played:
    """Play a loop of a clip."""
    joints = forward_kinematics(clip.skeleton, loop.rotations, loop.root)
    parts, count = [joints], len(joints) - 1
    for _ in range(cycles - 1):
        joints = loop.travel.places(joints)
        parts.append(joints[1:])
    return Played(np.concatenate(parts), tuple(count * number for number in range(1, cycles)))


class Bars:
    """The bars that the loops of a clip have to keep."""

    def __init__(self, clip: MotionClip, window: int) -> None:
        """Measure the source; `window` is the number of frames of the blend."""
        self._clip, self._window = clip, window
        joints = clip.joints.astype(np.float64)
        self._step, self._change = (np.percentile(values, PERCENTILE, axis=0) for values in steps_of(joints))
        self._skate = self._skating(joints, find_contacts(joints, clip.skeleton, clip.fps))

    def best(self, loop: Closed) -> Closed | Fault:
        """Return the loop, with its seam where joints jump least in the blend, or the bar that it misses even there."""
        play = played(self._clip, loop)
        jumps = [self._jump(play, earlier) for earlier in range(loop.room + 1)]
        earlier = min(range(len(jumps)), key=lambda number: jumps[number].excess)
        if jumps[earlier].excess > 1.0:
            return jumps[earlier]
        begun = loop.begun(earlier)
        return self._foot_fault(played(self._clip, begun)) or begun

    def _jump(self, play: Played, earlier: int) -> Fault:
        """Return the joint whose step, or change of step, at a seam is the largest beside what is usual in the source.

        Args:
            play: cycles of a loop.
            earlier: frames before its end at which the seam is.
        """
        step, change = steps_of(play.joints)
        seams = np.array(play.seams) - earlier
        faults = [
            self._excess("moves", np.maximum(step[seams - 1], step[seams]).max(axis=0), self._step),
            self._excess("changes its step by", change[seams - 1].max(axis=0), self._change),
        ]
        return max(faults, key=lambda fault: fault.excess)

    def _excess(self, verb: str, found: Array, usual: Array) -> Fault:
        allowed = usual + ROUNDING
        joint = int((found / allowed).argmax())
        name, is_, may = self._clip.skeleton.joint_names[joint], 1000 * found[joint], 1000 * usual[joint]
        excess = float(found[joint] / allowed[joint])
        return Fault(excess, f"{name} {verb} {is_:.1f} mm at the seam, {may:.1f} allowed")

    def _foot_fault(self, play: Played) -> Fault | None:
        """Return the fault of feet: one stands twice in a row at a seam, or they slide more than in the source."""
        contacts = find_contacts(play.joints, self._clip.skeleton, self._clip.fps)
        feet = supports(play.joints, contacts, self._clip.skeleton, self._clip.fps)
        for (_, end, foot), (begin, _, other) in pairwise(standing_spans(feet)):
            around = (end - 1 <= seam + self._window and begin >= seam - self._window for seam in play.seams)
            if foot == other and any(around):
                return Fault(2.0, f"the {('left', 'right')[foot]} foot stands twice in a row at the seam")
        found, allowed = self._skating(play.joints, contacts), SKATE * self._skate + SLACK
        if found <= allowed:
            return None
        reason = f"standing feet slide at {1000 * found:.1f} mm/s, {1000 * allowed:.1f} allowed"
        return Fault(found / allowed, reason)

    def _skating(self, joints: Array, contacts: Bool) -> float:
        return skate(joints, contacts, self._clip.skeleton, self._clip.fps)


def steps_of(joints: Array) -> tuple[Array, Array]:
    """Return the steps (T - 1, J) of joints (T, J, 3) from frame to frame, and the changes of step (T - 2, J)."""
    step = np.diff(joints, axis=0)
    return np.linalg.norm(step, axis=-1), np.linalg.norm(np.diff(step, axis=0), axis=-1)
