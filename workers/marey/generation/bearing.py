"""Bodies that bear themselves as their prompt says: stooped, like a zombie, with arms crossed; and gestures.

Networks read such words as another action, or not at all: of "a sad woman walks with her head hanging" one made jumps.
The words are left out of what a network reads (`marey.text.plain_action`), and the pose of the bearing is drawn on the
motion that it makes: trunk, head, shoulders and hips are turned and moved, the knees solved, and arms brought to their
place by two-bone inverse kinematics, as in the made clips of the training data. The poses are in
`marey/vocabulary/bearings.toml`.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from marey.checks.kinematics import smooth
from marey.drawing.holds import LYING
from marey.generation.done import AGAIN_HELD, BEGINS_S, FALL, PACES, raised_s
from marey.generation.gaits import GAITS, STAMP_S, stomping
from marey.generation.hits import states_hit
from marey.generation.leans import trunk_shares
from marey.generation.marching import marches_straight
from marey.generation.port import MotionFeatures, Request
from marey.generation.strides import drags_feet
from marey.generation.timed import TimedText
from marey.generation.wish import action_of
from marey.motion.features import FeatureLayout, encode_all
from marey.motion.rotations import normalize
from marey.motion.skeleton import HUMANML3D
from marey.posing.standing import ARMS, LEFT, LEGS, NECK, OTHER_SIDE, RIGHT, StandingBody, envelope, way_through
from marey.vocabulary.bearing_words import stated_bearings
from marey.vocabulary.bearings import (
    DRAWN_AS,
    DRAWN_ON,
    SHOWN_BY,
    ArmPose,
    Bearing,
    Gait,
    Keys,
    StatedBearing,
    Vector,
    load_bearings,
)
from marey.vocabulary.in_place import goes_in_place
from marey.vocabulary.lengths import stated_length

Array = NDArray[np.floating]
Float32 = NDArray[np.float32]

_ACTS = {**DRAWN_AS, **DRAWN_ON}
_LEG_JOINTS = [joint for leg in LEGS.values() for joint in leg]
_ONE_FOOT = re.compile(r"\bfoot\b")
BEARING = "bearing"
"""Key of a manifest, and of the record of a row of a timeline."""
PASSES_S = 0.25
"""Standard deviation of the filter by which a body passes into a bearing in the middle of a motion, seconds."""
BROUGHT_S = 0.8
"""Seconds before arms are brought to their place, and after they have left it."""
FACE_S, STANDS = 0.5, frozenset({"idle"})
"""Seconds before hands that are held at the face come there, in a motion of their own, and the actions of such ones."""
SOBS = 0.5
"""Degrees by which the head shakes for each one by which sobbing shoulders rise."""
DOWN_S = 1.1
"""Seconds in which who sits or kneels down comes there, before hands go to the face."""
PLANTS, PLANT_UP = (-0.22, 0.3), 0.6
"""Metres by which a hand on a cane goes back and ahead of its place at most, and share of the height of the foot by
which it is lifted on its way."""
SWING_S = 0.5
"""The same of the filter that leaves an arm's way and takes out its swing."""
LATEST_S = 1.1
"""Seconds before a gesture at most."""
UPPER_STEPS = 0.02
"""Metres a frame by which the feet pass each other in a walk that rolls in full."""
MOVES_FIRST, LATE = frozenset({"sit-down", "stand-up", "sit-floor", "kneel"}), 0.5
"""Actions that are done before a gesture, and the share of the motion that they take."""
SEATED_SHARE = 0.7
"""Share of the lean of a standing trunk that one has that does not lean from the hips."""
KEYED_S = 0.06
"""Standard deviation of the filter of ways through keys, seconds: they pass without a halt."""
FOLDS = 1.8
"""By how much an arm folds before it makes strokes: a hand that reaches past its place looks like one more knock."""
AHEAD = ("shoulder", "chest")
"""Places that hands are measured from which they come to from below."""
GOLDEN = 0.618
"""Share of the bounds of paces by which they differ from seed to seed."""
LEAST = 2
"""Strokes of a gesture of which no number is stated, at least."""
EDGE_S, THERE = 0.15, 0.86
"""Seconds before and after a gesture at least, and the share of the seconds in which a hand comes to its place from
which on it makes strokes."""
SHORTEST = 10
"""Frames of the shortest motion on which anything is drawn."""


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


@dataclass(frozen=True)
class _Ways:
    """How much of a bearing there is, 0 to 1 (T,): on trunk and head, on the arms, and on hips and legs.

    Attributes:
        done: seconds (T,) of its strokes or keys that are done at each frame; None = it goes on and on.
        times: rounds through its keys.
    """

    trunk: Array
    arms: Array
    legs: Array
    done: Array | None = None
    times: int = 1


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
    found, carried = [], list[StatedBearing]()
    for k, row in enumerate(request.timeline):
        action, own = action_of(row.text), stated_bearings(row.text.said)
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


def borne(motion: MotionFeatures, layout: FeatureLayout, spans: Sequence[BorneSpan]) -> Float32:
    """Return features (T, D) with the bearings of a motion drawn.

    Args:
        motion: as generated, in the layout's own units, on the skeleton of HumanML3D.
        layout: of the features.
        spans: by `borne_spans`.
    """
    features: Float32 = motion.features
    spans = [span for span in spans if not any(each.bearing.moves for each in span.stated)]
    if not spans or len(features) < SHORTEST or layout.skeleton.name != HUMANML3D.name:
        return features
    joints = layout.decode(features).astype(np.float64)
    for span in spans:
        rng = np.random.default_rng([span.seed, span.begin])
        for gait, side in _gaits_of(span).items():
            times = next((each.times for each in span.stated if each.bearing.gait == gait), None)
            draw = partial(stomping, times=times) if gait == "stomp" else GAITS[gait]
            if times is not None and not side and any(_ONE_FOOT.search(each.words) for each in span.stated):
                side = str(rng.choice(list(LEGS)))
            joints = draw(joints, layout, span.begin, span.end, side, rng)
    body = StandingBody(joints)
    shares, all_drawn = trunk_shares(span.stated for span in spans), _drawn(spans, len(features), layout.fps)
    drawings = [
        _Drawing(body, each, ways, layout.fps, rng, shares.get(each.name, 1.0)) for each, ways, rng in all_drawn
    ]
    for drawing in drawings:
        drawing.draw_body()
    for drawing in drawings:
        drawing.draw_arms()
    drawn = body.solved()
    if not any(each.shown_in(span.action) == "body" for span in spans for each in span.stated):
        drawn[:, _LEG_JOINTS] = joints[:, _LEG_JOINTS]  # solved knees of who kneels go through the floor
    return encode_all(layout, drawn)


def _gaits_of(span: BorneSpan) -> dict[Gait, str]:
    """Return the gaits of a part of a motion, each once, and the side that its prompt names."""
    gaits: dict[Gait, str] = {}
    for each in span.stated:
        if (gait := each.bearing.gait) and each.shown_in(span.action) == "body":
            gaits[gait] = each.side or gaits.get(gait, "")
    return gaits


def _drawn(
    spans: Sequence[BorneSpan], frames: int, fps: float
) -> Iterator[tuple[StatedBearing, _Ways, np.random.Generator]]:
    """Yield each bearing with how much of it there is, in the order of the vocabulary."""
    names = {each.name: each for span in spans for each in span.stated}
    for name in sorted(names, key=list(load_bearings()).index):
        having = [(span, each) for span in spans for each in span.stated if each.name == name]
        rng = np.random.default_rng([having[0][0].seed, having[0][0].begin, len(name)])
        for span, each in having:
            if each.is_done:
                filled = _filling(span, each, fps)
                way, done = _once(span, filled, frames, fps, rng)
                legs = way if each.shown_in(span.action) == "body" else np.zeros(frames)
                yield each, _Ways(way, way, legs, done, filled.times or 1), rng
        having = [(span, each) for span, each in having if not each.is_done]
        if not having:
            continue
        held = {"body": np.zeros(frames), "upper": np.zeros(frames), "trunk": np.zeros(frames)}
        for span, each in having:
            begin, end = _held_in(span, each, fps, goes_on=any(other.end == span.begin for other, _ in having))
            held[each.shown_in(span.action) or "trunk"][begin:end] = 1.0
        legs, arms, trunk = (
            np.clip(smooth(mask, PASSES_S, fps), 0.0, 1.0)
            for mask in (held["body"], held["body"] + held["upper"], held["body"] + held["upper"] + held["trunk"])
        )
        yield having[-1][1], _Ways(trunk, arms, legs), rng


def _held_in(span: BorneSpan, stated: StatedBearing, fps: float, *, goes_on: bool) -> tuple[int, int]:
    """Return the first frame in which a bearing is held in a part of a motion, and the one after the last: arms that
    are brought to their place come there after a moment, or what is done first, and those that come down do so before
    the end. `goes_on`: it is held in the part before."""
    frames, moment = span.end - span.begin, round(BROUGHT_S * fps)
    begin, end = span.begin, span.end
    at_face = span.free and not stated.whole and span.action in STANDS and _is_at_face(stated.bearing)
    if at_face and not goes_on:  # a body stands with hanging arms before and after
        begin, end = begin + min(round(FACE_S * fps), frames // 4), end - min(moment, frames // 4)
    elif span.action in MOVES_FIRST and (stated.is_brought or stated.bearing.work):
        begin += round(LATE * frames)
    elif span.action in MOVES_FIRST and _is_at_face(stated.bearing) and not (stated.whole or goes_on):
        begin += round(min(LATE * frames, DOWN_S * fps))
    elif stated.is_brought and not goes_on:
        begin += min(moment, frames // 2)
    if stated.times is not None and stated.bearing.gait == "stomp":
        begin, end = begin + round(BEGINS_S * fps), end - round((BEGINS_S + PASSES_S) * fps)
        end = max(min(end, begin + round((stated.times * STAMP_S + BEGINS_S) * fps)), begin + 1)
    if stated.ends:
        end -= min(moment + round(PASSES_S * fps), frames // 4)
    return begin, end


def _is_at_face(bearing: Bearing) -> bool:
    """Return True if a hand is held at the head all the time."""
    return any(pose.at == "head" and not pose.path for pose in bearing.arms.values())


def _filling(span: BorneSpan, stated: StatedBearing, fps: float) -> StatedBearing:
    """Return a gesture that is alone in a part of a stated length with as many strokes, or held as long, as fill it."""
    bearing, asked = stated.bearing, stated.times is not None or stated.hold_s is not None
    if asked or not bearing.gesture or len(span.gestures) > 1 or span.action in MOVES_FIRST:
        return stated
    if stated_length(span.said).seconds is None:
        return stated
    rise = raised_s(bearing)
    room = (span.end - span.begin) / fps - rise - (bearing.fall_s or FALL * rise) - 2 * EDGE_S
    if not bearing.strokes_s(1):
        return replace(stated, hold_s=max(room, bearing.hold_s[0]))
    rounds = int((room + bearing.returns_s) / (bearing.strokes_s(2) - bearing.strokes_s(1)))
    return replace(stated, times=max(rounds, 1))


def _once(
    span: BorneSpan, stated: StatedBearing, frames: int, fps: float, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Return how much of a gesture there is, 0 to 1 (T,), and the seconds (T,) of its strokes or keys that are done: it
    is made in its share of the span, of one who sits down or stands up at the end of it.

    Strokes are as many as are stated, and whole ones otherwise. Of gestures without strokes the number says how often
    they are made.
    """
    bearing, count = stated.bearing, len(span.gestures)
    at = [each.name for each in span.gestures].index(stated.name)
    first = span.begin + (LATE * (span.end - span.begin) if span.action in MOVES_FIRST else 0.0)
    begin, end = (first + (span.end - first) * share / count for share in (at, at + 1))
    seconds, rise, hold = (end - begin) / fps, raised_s(bearing), stated.hold_s or rng.uniform(*bearing.hold_s)
    fall, pace = bearing.fall_s or FALL * rise, PACES[0] + (PACES[1] - PACES[0]) * (GOLDEN * span.seed % 1.0)
    again = stated.times if stated.times is not None and not bearing.strokes_s(1) else 1
    through = bearing.strokes_s(stated.times or (1 if bearing.keys else max(round(hold * bearing.stroke_hz), LEAST)))
    if through:
        hold = through / pace if stated.times or not bearing.keys else max(hold, through / pace)
        room = max(seconds - rise - fall - 2 * EDGE_S, 0.3 * hold)
        hold, pace = min(hold, room), pace * max(hold / room, 1.0)
    elif again > 1:
        hold *= AGAIN_HELD
        fast = min(1.0, (seconds - 2 * EDGE_S) / (again * (rise + hold + fall)))
        rise, hold, fall = rise * fast, hold * fast, fall * fast
        once, start = rise + hold + fall, max((seconds - again * (rise + hold + fall)) / 2, 0.0)
        ways = [envelope(frames, begin / fps + start + number * once, rise, hold, fall) for number in range(again)]
        return np.max(ways, axis=0), np.maximum(np.arange(frames) / fps - begin / fps - start - rise, 0.0)
    fast = min(1.0, seconds / (rise + fall + (hold if through else 0.6 * hold)))
    rise, fall = rise * fast, fall * fast
    if not through:
        hold = min(hold, max(seconds - rise - fall - 2 * BEGINS_S, 0.5 * hold * fast))
    left = (seconds - rise - fall - hold) / 2
    start = max(min(rng.uniform(BEGINS_S, LATEST_S), left), 0.0)
    start += begin / fps
    since = np.maximum(np.arange(frames) / fps - start - THERE * rise, 0.0)
    return envelope(frames, start, rise, hold, fall), np.minimum(pace * since, through) if through else since


class _Drawing:
    """One bearing that is drawn on a body."""

    def __init__(
        self,
        body: StandingBody,
        stated: StatedBearing,
        ways: _Ways,
        fps: float,
        rng: np.random.Generator,
        share: float = 1.0,
    ) -> None:
        self._body, self._ways, self._rng, self._share = body, ways, rng, share
        self._bearing: Bearing = stated.bearing
        self._arms = arms_of(stated)
        self._done, self._times = ways.done, ways.times
        self._is_exchanged = stated.acts == LEFT and len(self._arms) == len(ARMS)
        self._time = np.arange(len(ways.trunk)) / fps
        self._fps = fps
        self._pace = float(rng.uniform(0.92, 1.08))
        self._size, self._begins = float(rng.uniform(0.9, 1.1)), 0.0 if ways.done is not None else rng.uniform(0, 0.6)

    def draw_body(self) -> None:
        """Draw trunk, head, shoulders and hips."""
        bearing, body = self._bearing, self._body
        way, legs = self._ways.trunk * self._size, self._ways.legs * self._size
        keys = bearing.keys or Keys(times=(0.0,))
        if bearing.sink or keys.sink or bearing.back:
            body.shift(-(self._share * bearing.sink + self._keyed(keys.sink)) * legs, -bearing.back * legs)
        if bearing.trunk or keys.trunk:
            trunk = self._share * bearing.trunk + self._keyed(keys.trunk)
            body.bow(trunk * legs, arms_hang=0.85, head=0.0)
            body.lean(SEATED_SHARE * trunk * (way - legs), "left")
        if keys.twist:
            body.lean((-1.0 if self._is_exchanged else 1.0) * self._keyed(keys.twist) * way, "up")
        if bearing.heave:
            heave = self._swung(bearing.heave_hz)
            body.lean(bearing.heave * way * heave, "left")
            body.shrug(bearing.sob * way * heave)
            body.turn(NECK, "left", SOBS * bearing.sob * way * heave)
        if bearing.aside:
            body.lean((1.0 if LEFT in self._arms else -1.0) * bearing.aside * legs, "forward")
        if bearing.roll:
            aside = self._swung(bearing.roll_hz) if bearing.roll_hz else self._steps()
            body.lean(bearing.roll * legs * aside, "forward")
        if bearing.twists:
            body.lean(bearing.twists * legs * self._steps(), "up")
        if bearing.head or keys.head:
            body.turn(NECK, "left", (bearing.head + self._keyed(keys.head)) * way)
        if keys.tilt:
            body.turn(NECK, "forward", self._keyed(keys.tilt) * way)
        if bearing.tilt:
            side = self._rng.choice([-1.0, 1.0]) if not bearing.roll_hz else -self._swung(0.7 * bearing.roll_hz)
            body.turn(NECK, "forward", bearing.tilt * way * side)
        if bearing.shrug or keys.shrug:
            body.shrug((bearing.shrug + self._keyed(keys.shrug)) * way)

    def draw_arms(self) -> None:
        """Draw the swing of the arms and their poses; all of the body is drawn before."""
        if self._bearing.swing != 1.0:
            for side in ARMS:
                self._swing(side)
        for side, pose in self._arms.items():
            self._move(side, pose)

    def _swung(self, hz: float) -> Array:
        """Return an oscillation (T,) between -1 and 1, unsteady in pace."""
        phase = self._rng.uniform(0, 2 * np.pi)
        return np.sin(2 * np.pi * hz * self._time + phase + 0.5 * np.sin(0.7 * hz * 2 * np.pi * self._time))

    def _steps(self) -> Array:
        """Return -1 to 1 (T,): 1 while the body goes over its right foot, -1 over its left one."""
        body = self._body
        apart = body.local(body.joints[:, 7] - body.joints[:, 8], LEFT)[:, 2]
        moves = np.gradient(smooth(apart, 0.05, self._fps))
        return np.clip(moves / max(float(np.percentile(np.abs(moves), 85)), UPPER_STEPS), -1.0, 1.0)

    def _swing(self, side: str) -> None:
        """Make the swing of an arm smaller or larger."""
        body, (_, shoulder, elbow, wrist) = self._body, ARMS[side]
        bones = []
        for a, b in ((shoulder, elbow), (elbow, wrist)):
            here = body.local(normalize(body.joints[:, b] - body.joints[:, a]), side)
            calm = smooth(here, SWING_S, self._fps)
            bones.append(normalize(calm + self._bearing.swing * (here - calm)))
        body.move_arm(side, self._ways.arms, *bones, lag=0.0, straight=True)

    def _move(self, side: str, pose: ArmPose) -> None:
        """Bring an arm to its pose."""
        body, (_, shoulder, elbow, wrist) = self._body, ARMS[side]
        if pose.at:
            place = self._place(side, pose.at)
            swung = self._strokes(pose.hz)[:, None]
            hand = self._keyed(pose.path) if pose.path else np.array(pose.hand)
            target = body.from_shoulder(side, place) + hand + swung * np.array(pose.shake)
            if pose.plants:
                target = target + self._planted(side)
            upper, fore = body.reach(side, target, pose.elbow)
        else:
            upper, fore = (
                normalize(np.broadcast_to(np.asarray(wanted, np.float64), (len(body.joints), 3)))
                if wanted is not None
                else body.local(normalize(body.joints[:, b] - body.joints[:, a]), side)
                for wanted, a, b in ((pose.upper, shoulder, elbow), (pose.fore, elbow, wrist))
            )
        folds = FOLDS if self._done is not None and pose.at in AHEAD and self._bearing.stroke_hz else 1.0
        straight = not self._bearing.gesture or folds > 1.0
        body.move_arm(side, pose.share * self._ways.arms, upper, fore, lag=0.0, straight=straight, folds=folds)

    def _planted(self, side: str) -> Array:
        """Return by how much (T, 3) a hand goes along with the foot of the other side: outward, up and forward."""
        body = self._body
        foot = body.joints[:, LEGS[OTHER_SIDE[side]][2]]
        ahead = np.clip(body.local(foot - body.joints[:, 0], side)[:, 2], *PLANTS)
        up = PLANT_UP * np.maximum(foot[:, 1] - foot[:, 1].min() - 0.02, 0.0)
        return smooth(np.stack([np.zeros_like(ahead), up, ahead], axis=-1), 0.05, self._fps)

    def _keyed(self, values: Sequence[float] | Sequence[Vector]) -> Array:
        """Return numbers (T,), or points (T, 3), that are `values` at the times of the keys; 0 if there are none."""
        frames = len(self._time)
        if not values or self._bearing.keys is None:
            return np.zeros(frames)
        times = self._bearing.keys.times
        if self._done is None:
            at = (self._pace * self._time + self._begins) % times[-1]
            return smooth(way_through(at, times, values), KEYED_S, self._fps)
        again = times[-1] + self._bearing.returns_s
        rounds = [number * again + np.array(times) for number in range(self._times)]
        points = np.concatenate([np.asarray(values, np.float64)] * self._times)
        return smooth(way_through(self._done, np.concatenate(rounds), points), KEYED_S, self._fps)

    def _strokes(self, hz: float) -> Array:
        """Return an oscillation (T,) between -1 and 1: of a gesture from its least on, where it ends too if it makes
        whole strokes, so that each of them is one way there and back."""
        if self._done is None:
            return np.sin(2 * np.pi * hz * self._time + self._begins)
        return -np.cos(2 * np.pi * hz * self._done)

    def _place(self, side: str, at: str) -> Array:
        """Return the point (T, 3) that a hand's place is measured from."""
        joints = self._body.joints
        return {
            "chest": joints[:, [arm[1] for arm in ARMS.values()]].mean(1),
            "head": joints[:, HUMANML3D.index("head")],
            "hips": joints[:, 0],
            "shoulder": joints[:, ARMS[side][1]],
            "knee": joints[:, LEGS[side][1]],
            "foot": joints[:, LEGS[side][3]],
        }[at]


def arms_of(stated: StatedBearing) -> Mapping[str, ArmPose]:
    """Return the poses of the arms by side.

    Where one arm acts, or both do the same, it is the side that the prompt names; else they are exchanged if it names
    the left, since poses of two arms act with the right one.
    """
    arms, side = stated.bearing.arms, stated.acts
    if not side or stated.bearing.gait:
        return arms
    if len(arms) == 1:
        return {side: next(iter(arms.values()))}
    if arms.get(LEFT) == arms.get(RIGHT):
        return {side: arms[side]} if arms else arms
    return {OTHER_SIDE[one]: pose for one, pose in arms.items()} if side == LEFT else arms


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
