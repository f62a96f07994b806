"""Bodies that bear themselves as their prompt says: stooped, like a zombie, with arms crossed; and gestures.

Networks read such words as another action, or not at all: of "a sad woman walks with her head hanging" one made jumps.
The words are left out of what a network reads (`marey.text.plain_action`), and the pose of the bearing is drawn on the
motion that it makes: trunk, head, shoulders and hips are turned and moved, the knees solved, and arms brought to their
place by two-bone inverse kinematics, as in the made clips of the training data. The poses are in
`marey/vocabulary/bearings.toml`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from marey.drawing.holds import LYING
from marey.generation.hits import states_hit
from marey.generation.marching import marches_straight
from marey.generation.port import Request
from marey.generation.strides import drags_feet
from marey.generation.timed import TimedText
from marey.generation.wish import action_of
from marey.vocabulary.bearing_words import stated_bearings
from marey.vocabulary.bearings import (
    DRAWN_AS,
    DRAWN_ON,
    SHOWN_BY,
    Side,
    StatedBearing,
    load_bearings,
)
from marey.vocabulary.hurt_legs import hurt_leg
from marey.vocabulary.in_place import goes_in_place

_ACTS = {**DRAWN_AS, **DRAWN_ON}
LIMP = "limp"
"""Gait of who has a leg that hurts."""
BEARING = "bearing"
"""Key of a manifest, and of the record of a row of a timeline."""


@dataclass(frozen=True)
class BorneSpan:
    """A part of a motion with the bearings that are drawn on it.

    Attributes:
        begin, end: its first frame, and the one after its last.
        stated: as `fitting` orders them.
        action: id of the action, which leaves some parts of the body free for them.
        seed: decides sizes and times.
        said: the prompt.
        free: it is a whole motion of one movement, whose length is left open.
    """

    begin: int
    end: int
    stated: tuple[StatedBearing, ...]
    action: str
    seed: int
    said: str = ""
    free: bool = False

    def record(self) -> list[dict[str, str]]:
        """Return what the manifest says."""
        return [{"name": each.name, **({"side": each.side} if each.side else {})} for each in self.stated]

    @property
    def gestures(self) -> list[StatedBearing]:
        """Those that are begun and ended in it."""
        return [each for each in self.stated if each.is_done]


def borne_spans(request: Request, fps: float, frames: int) -> list[BorneSpan]:
    """Return the parts of a motion whose prompts ask for bearings that fit their actions.

    None in streams, and in motions around kept frames. What a sequence says of its person holds for all its movements,
    and a manner or held arms of one movement for those after it, until another takes their place.

    Args:
        request: of the motion.
        fps: of the features.
        frames: of the features.
    """
    if request.kept or request.free or request.recording is not None:
        return []
    if request.timeline is None:
        action = action_of(request.text)
        said = request.text.said
        stated = fitting(_with_drawn(stated_bearings(said), action, said), action)
        return [BorneSpan(0, frames, stated, action, request.seed, said, request.open)] if stated else []
    whole = [each for each in stated_bearings(request.text.said) if each.whole] if request.is_sequence else []
    hurt = hurt_leg(request.text.said.lower()) if request.is_sequence else ""
    found, carried = [], list[StatedBearing]()
    for k, row in enumerate(request.timeline):
        action, own = action_of(row.text), _with_hurt_leg(stated_bearings(row.text.said), hurt)
        kept = [each for each in carried if not any(_replaces(other, each) for other in own)]
        posed = _posed(row, action)
        stated = fitting(_with_drawn([*whole, *kept, *own], action, row.text.said), posed)
        if row.held.deed is not None:  # the hands are at work
            stated = tuple(each for each in stated if not (each.bearing.arms or each.bearing.gesture))
        if request.is_sequence:
            carried = [each for each in (*kept, *own) if each in stated and each.bearing.lasts]
        if stated:
            end = min(round(row.end * fps), frames)
            found.append(BorneSpan(round(row.start * fps), end, stated, posed, request.seed + k, row.text.said))
    return found


def _with_hurt_leg(stated: Sequence[StatedBearing], side: Side) -> Sequence[StatedBearing]:
    """Return the bearings of a movement, of which a limp is on the leg that another movement of its prompt hurts, where
    its own words name none: "is shot in the right leg and limps on"."""
    return [replace(each, side=each.side or side) if each.bearing.gait == LIMP else each for each in stated]


def _posed(row: TimedText, action: str) -> str:
    """Return the action that says which parts of the body are free in a row: who sits, kneels or crouches and does
    nothing else has free arms."""
    if row.held.begin != row.held.own or not row.held.own or action not in ("idle", *DRAWN_AS):
        return action
    return "lie" if row.held.own in LYING else "sit"


def _with_drawn(stated: Sequence[StatedBearing], action: str, said: str) -> list[StatedBearing]:
    """Return bearings with the one that an action is drawn as; a load that the prompt names takes its place."""
    names_load = action in DRAWN_ON and any(each.bearing.load for each in stated)
    if action in DRAWN_AS and states_hit(said):  # who is hit and "stumbles back" takes a step, and is not drunk
        stated = [each for each in stated if each.whole or not each.bearing.gait]
    if goes_in_place(said, action):  # its knees are drawn as high as they go
        stated = [each for each in stated if each.bearing.gait not in ("high-knees", "skip", "stagger")]
    if marches_straight(said):  # its knees are drawn as high as they are said to be
        stated = [each for each in stated if each.bearing.gait != "high-knees"]
    if action == "walk" and drags_feet(said):
        stated = [each for each in stated if each.bearing.gait != "shuffle"]
    if not any(each.bearing.arms and each.bearing.lasts and not each.bearing.mood for each in stated):
        shown = [SHOWN_BY[each.name, action] for each in stated if (each.name, action) in SHOWN_BY]
        stated = [*stated, *map(StatedBearing, shown)]
    return [*stated, *([] if names_load else _drawn_as(action, said))]


def _drawn_as(action: str, said: str) -> list[StatedBearing]:
    """Return the bearing that an action is drawn as, in a list; an empty one if a network shows it, or its prompt
    states the form in which it is drawn whole."""
    is_whole = action in DRAWN_AS and states_hit(said)
    return [StatedBearing(_ACTS[action])] if action in _ACTS and not is_whole else []


def actions_alone(spans: Sequence[BorneSpan]) -> list[BorneSpan]:
    """Return the parts of a motion whose action itself is drawn, with nothing but that."""
    return [replace(span, stated=tuple(acts)) for span in spans if (acts := _drawn_as(span.action, span.said))]


def _replaces(new: StatedBearing, old: StatedBearing) -> bool:
    """Return True if a body that begins to bear itself in a new way ends an old one."""
    both = new.bearing, old.bearing
    return all(each.is_manner for each in both) or all(each.arms for each in both)


def fitting(stated: Sequence[StatedBearing], action: str) -> tuple[StatedBearing, ...]:
    """Return the bearings that an action can have, each once: in the order of the vocabulary, and behind them gestures
    in that of the prompt."""
    order = list(load_bearings())
    shown = [each for each in stated if each.shown_in(action)]
    moves = [each for each in shown if each.bearing.moves]  # no pose is drawn on a movement of the whole body
    once = {each.name: each for each in moves or shown}
    return tuple(sorted(once.values(), key=lambda each: len(order) if each.bearing.gesture else order.index(each.name)))


def with_bearing(manifest: Mapping[str, Any], spans: Sequence[BorneSpan], fps: float) -> dict[str, Any]:
    """Return a manifest that says which bearings are drawn: on the motion, or on the rows of its timeline."""
    if not spans:
        return dict(manifest)
    timeline: Mapping[str, Any] | None = manifest.get("timeline")
    if timeline is None:
        return {**manifest, BEARING: spans[0].record()}
    drawn = {span.begin: {BEARING: span.record()} for span in spans}
    rows = [{**row, **drawn.get(round(row["start"] * fps), {})} for row in timeline["rows"]]
    return {**manifest, "timeline": {**timeline, "rows": rows}}
