"""Bars of a loop, measured on several cycles played one after another."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from marey.motion.clip import MotionClip
from marey.motion.edits.loop_blend import Bool, Closed
from marey.motion.edits.loop_feet import standing_spans, supports
from marey.motion.edits.loop_search import PERCENTILE
from marey.motion.feet import find_contacts, skate
from marey.motion.kinematics import forward_kinematics
from marey.motion.rotations import Array

Moves = tuple[Array, Array]
"""Steps (T - 1, J) from frame to frame, and changes of step (T - 2, J), metres."""
PLAYED = 3
"""Cycles."""
SKATE = 1.1
"""Skating of a loop over that of its source."""
SLACK = 0.002
"""Metres a second that standing feet may skate more: a source whose feet are locked skates by rounding alone."""
ROUNDING = 1e-4
"""Metres."""
HITCH = 5e-4
"""Metres by which a joint that moves, or changes its step, more at the seam than anywhere else in the cycle shows."""
HURRY = 1.1
"""Largest step of a joint, or change of step, in the blend over the largest of the source, and at the seam over the
largest in the rest of the cycle."""


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

    def __init__(self, clip: MotionClip) -> None:
        """Measure the source."""
        self._clip = clip
        joints = clip.joints.astype(np.float64)
        moves = steps_of(joints)
        self._usual = tuple(np.percentile(values, PERCENTILE, axis=0) for values in moves)
        self._most = tuple(values.max(axis=0) for values in moves)
        self._skate = self._skating(joints, find_contacts(joints, clip.skeleton, clip.fps))

    def best(self, loop: Closed) -> Closed | Fault:
        """Return the loop, with its seam where joints jump least in the blend, or the bar that it misses even there."""
        play = played(self._clip, loop)
        moves, still = steps_of(play.joints), steps_of(in_place(play.joints))
        cycle = play.seams[0]
        seams: list[tuple[Fault, float]] = []
        for earlier in range(loop.room + 1):
            peaks = [(each, cycle - earlier, cycle) for each in (moves, still)]
            fault = _worst(self._jump(moves, cycle - earlier), *(self._peak(*peak, share=HURRY) for peak in peaks))
            seams.append((fault, _worst(fault, *(self._peak(*peak) for peak in peaks)).excess))
        earlier = min(range(len(seams)), key=lambda number: (seams[number][0].excess > 1.0, seams[number][1]))
        fault, hitch = seams[earlier]
        hurried = self._hurry(moves, cycle, loop.blend)
        if fault.excess > 1.0:
            return _worst(min((each for each, _ in seams), key=lambda each: each.excess), hurried)
        if hurried.excess > 1.0:
            return hurried
        begun = replace(loop.begun(earlier), hitch=hitch)
        return self._foot_fault(played(self._clip, begun), loop.blend) or begun

    def _jump(self, moves: Moves, seam: int) -> Fault:
        """Return the joint whose step, or change of step, at the seam is the largest beside what is usual in the
        source."""
        step, change = moves
        found = np.maximum(step[seam - 1], step[seam]), change[seam - 1]
        return self._fault(found, [usual + ROUNDING for usual in self._usual], "at the seam")

    def _peak(self, moves: Moves, seam: int, cycle: int, share: float = 1.0) -> Fault:
        """Return the joint whose step, or change of step, at the seam exceeds those in the rest of the cycle most.

        The change of step in the frame before the seam counts too: it ends in the seam's frame.
        """
        at: list[Array] = []
        rest: list[Array] = []
        for values, touching in zip(moves, (1, 2), strict=True):
            once = np.roll(values[:cycle], -seam, axis=0)
            at.append(once[-touching:].max(axis=0))
            rest.append(once[:-touching].max(axis=0))
        return self._fault(at, [share * most + HITCH for most in rest], "at the seam")

    def _hurry(self, moves: Moves, cycle: int, blend: int) -> Fault:
        """Return the joint whose step, or change of step, in the blend is the largest beside those of the source."""
        step, change = moves
        found = step[cycle - blend : cycle].max(axis=0), change[cycle - blend - 1 : cycle].max(axis=0)
        return self._fault(found, [HURRY * most + ROUNDING for most in self._most], "in the blend")

    def _fault(self, found: Sequence[Array], allowed: Sequence[Array], where: str) -> Fault:
        faults: list[Fault] = []
        for verb, value, may in zip(("moves", "changes its step by"), found, allowed, strict=True):
            joint = int((value / may).argmax())
            name, is_, most = self._clip.skeleton.joint_names[joint], 1000 * value[joint], 1000 * may[joint]
            reason = f"{name} {verb} {is_:.1f} mm {where}, {most:.1f} allowed"
            faults.append(Fault(float(value[joint] / may[joint]), reason))
        return _worst(*faults)

    def _foot_fault(self, play: Played, blend: int) -> Fault | None:
        """Return the fault of feet: one stands twice in a row at a seam, or they slide more than in the source."""
        contacts = find_contacts(play.joints, self._clip.skeleton, self._clip.fps)
        feet = supports(play.joints, contacts, self._clip.skeleton, self._clip.fps)
        for (_, end, foot), (begin, _, other) in pairwise(standing_spans(feet)):
            around = (end - 1 <= seam + blend and begin >= seam - blend for seam in play.seams)
            if foot == other and any(around):
                return Fault(2.0, f"the {('left', 'right')[foot]} foot stands twice in a row at the seam")
        found, allowed = self._skating(play.joints, contacts), SKATE * self._skate + SLACK
        if found <= allowed:
            return None
        reason = f"standing feet slide at {1000 * found:.1f} mm/s, {1000 * allowed:.1f} allowed"
        return Fault(found / allowed, reason)

    def _skating(self, joints: Array, contacts: Bool) -> float:
        return skate(joints, contacts, self._clip.skeleton, self._clip.fps)


def _worst(*faults: Fault) -> Fault:
    return max(faults, key=lambda fault: fault.excess)


def steps_of(joints: Array) -> Moves:
    """Return how far joints (T, J, 3) move from frame to frame, and how much that changes."""
    step = np.diff(joints, axis=0)
    return np.linalg.norm(step, axis=-1), np.linalg.norm(np.diff(step, axis=0), axis=-1)


def in_place(joints: Array) -> Array:
    """Return joints (T, J, 3) as seen from the root's place on the floor."""
    return joints - joints[:, :1] * np.array([1.0, 0.0, 1.0])
