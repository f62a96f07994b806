"""Timelines: one motion of several prompts at stated times.

Every row is generated alone, so that its action follows its prompt as a motion of its own does. Then the beginning of
each row but the first is generated again, without a prompt, between the frames that stay on both sides; so is a gap
between two rows. A row longer than the model's longest motion is continued behind kept frames. Windows of
all timelines of a batch are generated together, and each depends on its own row or boundary alone.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from marey.core.errors import InvalidInput
from marey.drawing.holds import BACK, CROUCH, FLOOR, FOURS, FRONT, KNEE, KNEES
from marey.generation.asked import changes_of, drawn_as_asked, generate_as_asked
from marey.generation.distances import with_distance
from marey.generation.passes import PassControl
from marey.generation.port import GenerationControl, Generator, Limits, NoControl, Request, S
from marey.generation.postured import MEETS, pass_into
from marey.generation.shots.flowing import BENT_ON, flowing, flowing_as_shown, without_rest
from marey.generation.shots.freezing import AS_BEFORE, freezes, frozen
from marey.generation.shots.going_on import (
    as_long_as_stated,
    aside_of,
    is_onward,
    is_way,
    keeps_course,
    rolls_landing,
    without_halt,
    without_wait,
)
from marey.generation.shots.headings import JoinedTurn, heading_change, with_whole_turns
from marey.generation.shots.levels import raised_rows
from marey.generation.shots.lifted_steps import with_steps
from marey.generation.shots.raised_arms import FIGHTING, RAISING, STEPPING_ASIDE, TURNING, guarded, kept_arms
from marey.generation.shots.setting_off import set_off, with_even_speed
from marey.generation.shots.strands import Fate, RowStrand, Strand, Transition
from marey.generation.shots.timeline_plan import even_parts, plan_timeline
from marey.generation.shots.way_lengths import as_long_as, metres_between, ways_back
from marey.generation.shots.windows import CONTEXT, Float32, Window, fill, most_frames
from marey.generation.steered import SETS_OFF_S
from marey.generation.timed import TimedText
from marey.generation.wish import action_of
from marey.items.timeline import TIMELINE_HINT, no_timelines
from marey.motion.features import FeatureLayout
from marey.motion.skeleton import HUMANML3D
from marey.quality.postures import RISE
from marey.text.features import TextFeatures
from marey.vocabulary.courses import RUNS
from marey.vocabulary.entries import load_vocabulary

RISE_SPEED = 0.6
"""Metres a second: between movements of a sequence whose pelvis is farther apart in height than `RISE`, time is left to
stand up or to go down at this speed, which is slower than one that is flagged (`marey.quality.postures`)."""

BENT, LOWER = frozenset({"bend-over"}), frozenset({KNEES, KNEE, FLOOR, BACK, FRONT, CROUCH, FOURS})
"""Actions from whose bent trunk a body goes on down, and the postures that it comes to."""
STRUCK = frozenset({"flinch"})
"""Actions of who is hit: that bends a body, which then bends on."""


@dataclass(frozen=True, eq=False)
class TimelineMotion:
    """The features of a timeline.

    Attributes:
        features: (T, D), in the layout's own units.
        timeline: its rows, with the times that they have.
    """

    features: Float32 = field(repr=False)
    timeline: tuple[TimedText, ...]


def check_timelines(generator: Generator[Any]) -> None:
    """Check that a model can generate timelines.

    Raises:
        InvalidInput: it cannot generate frames around others.
    """
    if not generator.limits.keeps:
        raise InvalidInput(no_timelines(generator.bundle.manifest.model), where="timeline", hint=TIMELINE_HINT)


def generate_timelines(
    generator: Generator[S],
    requests: Sequence[Request],
    settings: S | None = None,
    *,
    control: GenerationControl | None = None,
) -> list[TimelineMotion | None]:
    """Generate the motion of each timeline; None where `control` dropped it.

    Raises:
        InvalidInput: the model cannot generate frames around others, or features of another encoder.
    """
    check_timelines(generator)
    timelines = [_Timeline(request, generator.limits) for request in requests]
    windows = _Windows(generator, settings, control or NoControl(), timelines)
    windows.make([strand for timeline in timelines for strand in timeline.rows])
    for timeline in timelines:
        if timeline.open and not timeline.fate.dropped:
            timeline.settle(generator.layout)
        elif timeline.is_sequence and not timeline.fate.dropped and generator.layout.skeleton.name == HUMANML3D.name:
            set_off(timeline.rows, generator.layout, fixed=True)
        if timeline.is_sequence and not timeline.fate.dropped:
            timeline.lift(generator.layout)
    windows.make([strand for timeline in timelines for strand in timeline.open_transitions(generator.layout)])
    return [timeline.motion(generator.layout) for timeline in timelines]


def row_requests(request: Request, limits: Limits) -> list[Request]:
    """Return the request of each row of a timeline as a motion of its own: that of its first window."""
    timeline = _Timeline(request, limits)
    assert request.timeline is not None
    return [
        replace(strand.request(), scope=row.scope) for strand, row in zip(timeline.rows, request.timeline, strict=True)
    ]


class _Timeline:
    """A timeline while it is generated.

    Attributes:
        open: its length was not asked for, and may change with what is made: that of the movements of a prompt.
    """

    def __init__(self, request: Request, limits: Limits) -> None:
        assert request.timeline is not None
        self.limits = limits
        self.fate = Fate(drawing=request.drawing)
        self.is_sequence = request.is_sequence
        self.open = request.is_sequence and request.frames is None
        self.timeline = request.timeline
        self.seed = request.seed
        self.said = request.text.said
        self.back: dict[int, int] = {}
        self.plan = plan_timeline(request.timeline, request.seed, limits)
        self.rows = [
            RowStrand(self.fate, part, row, limits) for part, row in zip(self.plan.rows, request.timeline, strict=True)
        ]
        prompts = ["", *(row.text.said for row in request.timeline), ""]
        for number, (strand, row) in enumerate(zip(self.rows, request.timeline, strict=True)):
            strand.beside = prompts[number], prompts[number + 2]
            if row.made is not None:
                strand.add(Window(row.made, 0, len(row.made)))
                strand.changes = row.changes
        self.transitions: list[Transition] = []

    @property
    def windows(self) -> int:
        """Return the number of windows of the whole."""
        most = (most_frames(self.limits, 2), self.limits.max_frames - CONTEXT)
        between = sum(len(even_parts(part.frames, *most)) for part in self.plan.transitions)
        return sum(len(row.lengths) - len(row.windows) for row in self.rows) + between

    def settle(self, layout: FeatureLayout) -> None:
        """Set the times of rows that are made: each is as long as its motion, without a halt between two ways, and
        begins later where that begins much higher or lower than the one before ends; not where people stand on
        something, since all movements begin on one floor."""
        first = self.rows[0]
        if first.open and first.features is not None and is_way(first.text) and not first.is_drawn:
            first.features = without_wait(first.features, layout)
        for before, after in pairwise(self.rows):
            if before.features is not None and after.features is not None and before.goes_on and after.goes_on:
                before.features, after.features = without_halt(before.features, after.features, layout)
        for row in self.rows:
            if row.features is not None and not row.open and is_way(row.text):
                row.features = as_long_as_stated(row.features, layout, row.part.frames)
        if layout.skeleton.name == HUMANML3D.name:
            self._lead_back(layout)
            self._keep_guard(layout)
            self._flow(layout)
            set_off(self.rows, layout, fixed=False)
        later, times = 0.0, list[TimedText]()
        heights = [_pelvis_heights(row.features, layout) for row in self.rows]
        for number, (timed, row) in enumerate(zip(self.timeline, self.rows, strict=True)):
            assert row.features is not None
            if number:
                rise = abs(float(heights[number][0] - heights[number - 1][-1]))
                raised = _is_raised(timed.text) or _is_raised(self.timeline[number - 1].text)
                later += self._whole_tokens(rise / RISE_SPEED) if rise > RISE and not raised else 0.0
            start = timed.start + later
            later += (len(row.features) - row.part.frames) / self.limits.fps
            times.append(replace(timed, start=start, end=timed.end + later))
        self.timeline = tuple(times)
        self.plan = plan_timeline(self.timeline, self.seed, self.limits)
        for row, part in zip(self.rows, self.plan.rows, strict=True):
            row.part = part

    def _flow(self, layout: FeatureLayout) -> None:
        """Let drawn movements go on into each other, and leave out their rest beside others."""
        for row in self.rows:
            if row.features is not None and row.is_drawn and action_of(row.text) in TURNING:
                row.turn = heading_change(row.features, layout)
        for number, row in enumerate(self.rows):
            if row.features is not None and row.is_trimmed:
                beside = [each and not each.is_drawn for each in (self._row(number - 1), self._row(number + 1))]
                first = bool(beside[0]) and not row.turn  # a transition replaces its rest, and no part of the turn
                action = action_of(row.text)
                row.features = without_rest(row.features, layout, action, first=first, last=bool(beside[1]))
        for before, after in pairwise(self.rows):
            if before.features is None or after.features is None or after.held.meets or after.held.apart:
                continue
            struck = "drawn" in before.changes and action_of(before.text) in STRUCK and action_of(after.text) in BENT
            if after.is_drawn and freezes(action_of(before.text), action_of(after.text), after.text.said.lower()):
                held = frozen(before.features, len(after.features), layout)
                if held is not None:
                    before.features, after.features, after.entered = held.before, held.after, held.entered
                    after.changes = {**after.changes, "posture": AS_BEFORE}
                continue
            if before.is_drawn and action_of(before.text) in RAISING and action_of(after.text) in TURNING:
                kept = kept_arms(before.features, after.features, layout) if after.open else None
                if kept is not None:
                    before.features, after.features = kept.before, kept.after
            elif after.is_drawn and not before.is_drawn and is_onward(before.text, after.text):
                joined = flowing(
                    before.features, after.features, layout, whole=(False, not after.is_trimmed), onward=True
                )
                if joined is not None:
                    before.features, after.features, after.entered = joined.before, joined.after, joined.entered
            elif (before.is_drawn or struck) and after.is_drawn:
                whole = not before.is_trimmed, not after.is_trimmed
                down = struck or (action_of(before.text) in BENT and after.held.own in LOWER)
                pair, actions = (before.features, after.features), (action_of(before.text), action_of(after.text))
                if down:
                    joined = flowing(*pair, layout, whole=whole, entered=before.entered, down=True)
                else:
                    landing = before.is_trimmed and rolls_landing(before.text, after.text)
                    joined = flowing_as_shown(
                        *pair, layout, actions, whole=whole, entered=before.entered, landing=landing
                    )
                if joined is not None:
                    after.changes = {**after.changes, **({"posture": AS_BEFORE} if down else {})}
                    before.changes = {**before.changes, **({"posture": BENT_ON} if struck else {})}
                    before.features, after.features, after.entered = joined.before, joined.after, joined.entered

    def _lead_back(self, layout: FeatureLayout) -> None:
        """Let ways back be as long as those there."""
        ways = [row.as_way(layout) for row in self.rows]
        self.back = ways_back(self.said, ways)
        for number, there in self.back.items():
            first, last = self.rows[there], self.rows[number]
            if first.features is not None and last.features is not None and last.open:
                whole = ways[there].metres is not None or first.is_drawn or not first.open
                cut = as_long_as(first.features, last.features, layout)
                first.features, last.features = (first.features if whole else cut[0]), cut[1]

    def _far(self, frames: Float32, layout: FeatureLayout) -> Float32:
        """Return features (T, D) of the whole with its ways as long as is said."""
        spans = list[tuple[int, int, float]]()
        for number, row in enumerate(self.rows):
            metres = row.as_way(layout).metres
            if metres is not None:
                spans.append((*self._goes(number), metres))
        frames = with_distance(frames, layout, spans) if spans else frames
        back = [
            (*self._goes(number), metres_between(frames, layout, *self._goes(there)))
            for number, there in self.back.items()
        ]
        frames = with_distance(frames, layout, back) if back else frames
        for begin, end, metres in (*spans, *back):
            row = next(each for each in self.rows if each.part.start == begin)
            shown = round(metres_between(frames, layout, begin, end), 2)
            row.changes = {**row.changes, "distance": {"asked": round(metres, 2), "shown": shown}}
        return frames

    def _goes(self, number: int) -> tuple[int, int]:
        """Return the first frame of a way and the one after its last: it comes to a halt in the transition behind it,
        unless it goes on."""
        row, after = self.rows[number], self._row(number + 1)
        halts = after is not None and not is_way(after.text)
        return row.part.start, self._joined_at(number + 1) if halts else row.part.end

    def _keep_guard(self, layout: FeatureLayout) -> None:
        """Let fighters keep the guard up in the steps behind a blow or a block."""
        for number, row in enumerate(self.rows):
            before, after = self._row(number - 1), self._row(number + 1)
            if before is None or before.features is None or row.features is None:
                continue
            if action_of(before.text) in FIGHTING and action_of(row.text) in STEPPING_ASIDE:
                fights = after is not None and action_of(after.text) in FIGHTING
                held = guarded(before.features, row.features, after.features if after and fights else None, layout)
                if held is not None and before.is_drawn:
                    before.features, row.features = held.before, held.after
                    row.changes = {**row.changes, "posture": AS_BEFORE}

    def _row(self, number: int) -> RowStrand | None:
        """Return a row; None before the first and behind the last."""
        return self.rows[number] if 0 <= number < len(self.rows) else None

    def _whole_tokens(self, seconds: float) -> float:
        """Return a time in seconds, up to the next whole token of the model."""
        grid = self.limits.keeps
        return math.ceil(seconds * self.limits.fps / grid) * grid / self.limits.fps

    def lift(self, layout: FeatureLayout) -> None:
        """Set the heights of rows that are made: what follows a climb is done where that has ended."""
        rows = [(action_of(row.text), row.text.said.lower(), row.features) for row in self.rows]
        made = [(action, said, features) for action, said, features in rows if features is not None]
        for row, raised in zip(self.rows, raised_rows(made, layout), strict=True):
            row.features, row.base = raised.features, raised.base

    def open_transitions(self, layout: FeatureLayout) -> list[Transition]:
        """Return the transitions, once the rows are made; none of a dropped timeline."""
        if not self.fate.dropped:
            self.transitions = [
                Transition(part, before, after, self.limits, layout)
                for part, (before, after) in zip(self.plan.transitions, pairwise(self.rows), strict=True)
                if not (after.held.meets or after.entered)
            ]
        return self.transitions

    def _turns(self) -> list[JoinedTurn]:
        """Return the turns between movements that are joined."""
        found = list[JoinedTurn]()
        for number, row in enumerate(self.rows):
            before, after = self._row(number - 1), self._row(number + 1)
            if row.turn:
                begin = row.part.start if before is None else before.part.end
                follows = after is not None and is_way(after.text)
                aside = aside_of(after.text) if after is not None and follows else 0.0
                end = row.part.end if after is None else self._joined_at(number + 1)
                end += self._sets_off(aside)
                found.append(
                    JoinedTurn(0 if before is None else before.part.end, begin, end, row.turn + aside, follows)
                )
            elif before is not None and not before.turn and keeps_course(before.text, row.text):
                aside = aside_of(row.text)
                end = self._joined_at(number) + self._sets_off(aside)
                runs = action_of(row.text) in RUNS
                found.append(JoinedTurn(before.part.end, before.part.end, end, aside, follows=True, runs=runs))
        return found

    def _sets_off(self, aside: float) -> int:
        """Return the frames in which a body turns to a side to which it goes."""
        return round(SETS_OFF_S * self.limits.fps) if aside else 0

    def _joined_at(self, number: int) -> int:
        """Return the frame at which the transition to a row ends."""
        row = self.rows[number]
        return row.part.start + row.entered if row.entered else self.plan.transitions[number - 1].end

    def motion(self, layout: FeatureLayout) -> TimelineMotion | None:
        """Put rows and transitions together; None if the timeline was dropped."""
        if self.fate.dropped:
            return None
        first = self.rows[0].features
        assert first is not None
        frames = np.zeros((self.plan.frames, first.shape[1]), np.float32)
        for row in self.rows:
            assert row.features is not None
            frames[row.part.start : row.part.end] = row.features
            if row.held.meets:
                pass_into(frames, row.part.start, MEETS)
        for transition in self.transitions:
            frames = transition.write(frames)
        if self.is_sequence and layout.skeleton.name == HUMANML3D.name:
            frames = with_even_speed(frames, layout, self.rows, self.plan.transitions)
        if self.open and (turns := self._turns()):
            frames = with_whole_turns(frames, layout, turns)
        if self.open and layout.skeleton.name == HUMANML3D.name:
            frames = self._far(frames, layout)
        frames = with_steps(frames, layout, [(each.part.start, each.part.end) for each in self.transitions])
        timeline = zip(self.timeline, self.rows, strict=True)
        changed = tuple(replace(timed, changes=row.changes) for timed, row in timeline)
        return TimelineMotion(frames.astype(np.float32), changed)


class _Windows:
    """Generates the windows of several timelines, as many together as there are, one after another of each part."""

    def __init__(
        self,
        generator: Generator[S],
        settings: S | None,
        control: GenerationControl,
        timelines: Sequence[_Timeline],
    ) -> None:
        self._control, self._generator = control, generator
        self._generate: Callable[..., Sequence[object]]
        self._timelines = timelines
        self._total = sum(timeline.windows for timeline in timelines)
        self._done = 0

        def first(rows: Sequence[RowStrand], watched: GenerationControl) -> list[Window | None]:
            made = generate_as_asked(generator, [row.request() for row in rows], settings, control=watched)
            for row, motion in zip(rows, made, strict=True):
                row.changes = {} if motion is None else changes_of(motion)
            return [None if each is None else Window(each.features, 0, len(each.features)) for each in made]

        def following(strands: Sequence[RowStrand | Transition], watched: GenerationControl) -> list[Window | None]:
            return fill(generator, [strand.gap() for strand in strands], settings, control=watched)

        self._first, self._following = first, following

    def make(self, strands: Sequence[RowStrand] | Sequence[Transition]) -> None:
        """Generate all windows of parts that do not depend on each other."""
        for row in strands:
            if isinstance(row, RowStrand) and len(row.lengths) > 1 and not row.fate.dropped:
                self._draw(row)
        while left := [each for each in strands if not each.fate.dropped and len(each.windows) < len(each.lengths)]:
            watched = PassControl(self._control, self._owners(left), self._done, self._total)
            new = [each for each in left if isinstance(each, RowStrand) and not each.windows]
            if new:
                left, watched = new, PassControl(self._control, self._owners(new), self._done, self._total)
            made = self._first(new, watched) if new else self._following(left, watched)
            for strand, window in zip(left, made, strict=True):
                if window is None:
                    strand.fate.dropped = True
                else:
                    strand.add(window)
            self._done += len(made)

    def _draw(self, row: RowStrand) -> None:
        """Draw the whole of a row that is longer than the model's longest motion, if rules draw its movement."""
        request = replace(row.request(), frames=row.part.frames)
        motion = drawn_as_asked(self._generator, request)
        if motion is not None:
            self._total -= len(row.lengths) - 1
            row.lengths = [row.part.frames]
            row.changes = changes_of(motion)
            row.add(Window(motion.features, 0, len(motion.features)))
            self._done += 1

    def _owners(self, strands: Sequence[Strand]) -> list[int]:
        place = {id(timeline.fate): number for number, timeline in enumerate(self._timelines)}
        return [place[id(strand.fate)] for strand in strands]


def _pelvis_heights(features: Float32 | None, layout: FeatureLayout) -> NDArray[np.float32]:
    """Return the height (T,) of the pelvis over the floor, metres."""
    assert features is not None
    return layout.decode(features)[:, 0, 1]


def _is_raised(text: TextFeatures) -> bool:
    """Return True if the action that a text is read as ends or begins over the floor: on stairs, a ladder or a bar."""
    vocabulary = load_vocabulary()
    action = vocabulary.said_first(text.rewritten)
    return action is not None and vocabulary.need(action).support == "raised"
