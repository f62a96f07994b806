"""Wishes of a prompt: what its words ask for beside its action: a side, a number, a turn, a way, a pace, a gaze."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from marey.drawing.kinds import COUNTED
from marey.generation.begun import frames_to_begin
from marey.generation.distances import frames_of_distance
from marey.generation.drawn_sides import drawn_side
from marey.generation.fine import FINE
from marey.generation.fine_wish import FineWish
from marey.generation.paced import AskedPace
from marey.generation.port import Limits, Request
from marey.generation.pose_holds import HOLDING
from marey.generation.raising import stated_action
from marey.generation.steered import CLOSED, frames_of_circle
from marey.generation.stepped import frames_of_steps
from marey.generation.whole_body import AGAIN
from marey.selector.limbs import NamedLimb, limb_of
from marey.selector.matching import TURNING, Step, wanted_of
from marey.selector.repetitions import REPETITIONS
from marey.text.features import TextFeatures
from marey.vocabulary.counts import STEPPING, stated_count
from marey.vocabulary.courses import STRAIGHT as STRAIGHT_ON
from marey.vocabulary.courses import WAYS, WayCourse, stated_course
from marey.vocabulary.distances import stated_distance
from marey.vocabulary.entries import load_vocabulary
from marey.vocabulary.gazes import Glance, stated_gaze, without_gaze
from marey.vocabulary.held_poses import held_pose, stated_hold
from marey.vocabulary.turns import WHOLE, Turn, stated_spins, stated_turn

COUNTABLE = frozenset({*REPETITIONS, *AGAIN, *(COUNTED.keys() - FINE.keys())})
"""Actions that are done as often as a prompt asks: their number is found in a motion, or they are drawn so often."""
SPINNING = "spin"


@dataclass(frozen=True)
class Wish:
    """Everything that the words of a prompt ask for beside its action.

    Attributes:
        steps: the actions in their order; None = none that is known.
        action: id of the only one; empty = several, or none that is known.
        limb: that acts, on one side; empty = either.
        count: repetitions; None = any number.
        turn: how far the body turns; None = as it comes.
        course: on which it goes; None = as it comes.
        metres: that it goes; None = as many as it comes.
        pace: at which it is done.
        gaze: where the head turns.
        joined: a transition replaces the first frames.
        drawn_side: of the movement that is drawn, where it is not simply the limb that acts (`drawn_sides`); empty =
            either, or that of the limb.
        seed: of the motion.
    """

    steps: tuple[Step, ...] | None = None
    action: str = ""
    limb: NamedLimb | None = None
    count: int | None = None
    turn: Turn | None = None
    pace: AskedPace = field(default_factory=AskedPace)
    gaze: tuple[Glance, ...] = ()
    joined: bool = False
    drawn_side: str = ""
    course: WayCourse | None = None
    metres: float | None = None
    seed: int = 0

    @classmethod
    def of(cls, request: Request) -> Wish:
        """Read the prompt. Of streams, and of motions around kept frames, nothing is changed."""
        if request.kept or request.free or request.recording is not None:
            return cls()
        text = request.text
        steps = wanted_of(text.actions or (text.rewritten,))
        action = _action_of(text, steps) or _row_of_blows(steps or ())
        if action in ("", "idle") and (steps is None or action):
            action = stated_action(text.said) or action
        prompt, gaze = text.said, stated_gaze(text.said)
        if not action:
            return cls(steps, limb=limb_of(prompt) if steps is None else None, gaze=gaze)
        count = stated_count(prompt, action) if action in COUNTABLE else None
        if count is None and action in HOLDING & COUNTED.keys() and held_pose(prompt) is not None:
            count = 1
        if action == SPINNING:
            count = count or stated_spins(prompt)
        turn, pace = stated_turn(without_gaze(prompt), action), AskedPace.of(prompt, action)
        if action == SPINNING and count is not None:
            turn = Turn(count * WHOLE, count * WHOLE)
        course = stated_course(without_gaze(prompt), action) if count is None else None
        metres = stated_distance(prompt, action) if count is None and not _closes(course) else None
        own = drawn_side(prompt, action)
        limb = limb_of(prompt, action) if own is None else None
        joined = bool(request.beside[0])
        return cls(steps, action, limb, count, turn, pace, gaze, joined, own or "", course, metres, request.seed)

    @property
    def side(self) -> str:
        """`left` or `right` if an action is asked for on one side, else empty."""
        return next((each.side for step in self.steps or () for each in step if each.side in ("left", "right")), "")

    def fine(self, request: Request) -> FineWish:
        """Return what is asked for of a movement that is drawn."""
        fixed = request.frames is not None and not request.open
        return FineWish(self.count, self.drawn_side or self.side, request.text.said, fixed, request.beside)

    def for_network(self, request: Request, limits: Limits) -> Request:
        """Return the request that the network draws: as many frames as become the length asked for, if that is
        fixed, and those in which it does not move yet."""
        asked = self._for_length(request, limits)
        if asked.frames is None or self.count is not None:
            return asked
        return replace(asked, frames=frames_to_begin(self.action, asked.frames, limits))

    def length(self, request: Request, limits: Limits) -> int | None:
        """Return the frames of the motion that becomes the length asked for."""
        return self._for_length(request, limits).frames

    def _for_length(self, request: Request, limits: Limits) -> Request:
        if self.count is not None and self.action in STEPPING and request.open and request.frames is not None:
            return replace(request, frames=limits.within(frames_of_steps(self.count, limits.fps)))
        if self.course is not None and self.course.kind in CLOSED and (request.open or request.frames is None):
            return replace(request, frames=frames_of_circle(self.course, self.action, limits))
        fixed = None if request.open else request.frames
        far = frames_of_distance(self.metres, self.action, limits, fixed) if self.metres else None
        if far is not None:
            return replace(request, frames=far)
        hold = stated_hold(request.text.said) if self.action not in HOLDING else None
        if hold is not None and request.open:  # a pose that is not drawn is there all the time
            return replace(request, frames=limits.within(max(round(hold * limits.fps), request.frames or 0)))
        if self.pace.most == 1.0 or request.open or request.frames is None:
            return request
        return replace(request, frames=limits.within(round(request.frames * self.pace.most)))


def action_of(text: TextFeatures) -> str:
    """Return the id of the only action that a text asks for; empty if there are several or none."""
    return _action_of(text, wanted_of(text.actions or (text.rewritten,)))


def is_winding(text: TextFeatures) -> bool:
    """Return True if a text asks for a way off to a side, in a circle or in a zigzag."""
    course = stated_course(without_gaze(text.said), action_of(text))
    return course is not None and course.kind != STRAIGHT_ON


def _closes(course: WayCourse | None) -> bool:
    """Return True if a way comes back to where it began: as far as it is large."""
    return course is not None and course.kind in CLOSED


def _action_of(text: TextFeatures, steps: Sequence[Step] | None) -> str:
    return load_vocabulary().said_first(text.rewritten) or _one_action(steps or ())


def _one_action(steps: Sequence[Step]) -> str:
    """Return the id of the only action; a way before a turn ("walks ahead and then changes direction") is part of it.
    Empty if there are several or none."""
    named = {each.action for step in steps for each in step}
    if TURNING in named and named <= WAYS | {TURNING}:
        return TURNING
    return named.pop() if len(named) == 1 == len(steps) else ""


def _row_of_blows(steps: Sequence[Step]) -> str:
    """Return the id of the only action of several steps if it is drawn, kind by kind: "a jab, a cross and a hook"."""
    named = {each.action for step in steps for each in step}
    return named.pop() if named == {"punch"} else ""
