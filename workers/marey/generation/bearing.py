"""Bodies that bear themselves as their prompt says: stooped, like a zombie, with arms crossed; and gestures.

Networks read such words as another action, or not at all: of "a sad woman walks with her head hanging" one made jumps.
The words are left out of what a network reads (`marey.text.plain_action`), and the pose of the bearing is drawn on the
motion that it makes: trunk, head, shoulders and hips are turned and moved, the knees solved, and arms brought to their
place by two-bone inverse kinematics, as in the made clips of the training data. The poses are in
`marey/vocabulary/bearings.toml`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from marey.checks.kinematics import smooth
from marey.generation.asked import action_of
from marey.generation.gaits import limping, staggering
from marey.generation.port import MotionFeatures, Request
from marey.motion.features import FeatureLayout, encode_all
from marey.motion.rotations import normalize
from marey.motion.skeleton import HUMANML3D
from marey.posing.standing import ARMS, LEFT, NECK, OTHER_SIDE, RIGHT, StandingBody, envelope
from marey.text.features import TextFeatures
from marey.vocabulary.bearing_words import stated_bearings
from marey.vocabulary.bearings import ArmPose, Bearing, StatedBearing, load_bearings

Array = NDArray[np.floating]
Float32 = NDArray[np.float32]

BEARING = "bearing"
"""Key of a manifest, and of the record of a row of a timeline."""
PASSES_S = 0.25
"""Standard deviation of the filter by which a body passes into a bearing in the middle of a motion, seconds."""
SWING_S = 0.5
"""The same of the filter that leaves an arm's way and takes out its swing."""
BEGINS_S, FALL = 0.4, 1.15
"""Seconds before a gesture, at least, and how many times as long as it rises it takes to come down."""
UPPER_STEPS = 0.02
"""Metres a frame by which the feet pass each other in a walk that rolls in full."""
SHORTEST = 10
"""Frames of the shortest motion on which anything is drawn."""


@dataclass(frozen=True)
class BorneSpan:
    """A part of a motion with the bearings that are drawn on it.

    Attributes:
        begin, end: its first frame, and the one after its last.
        stated: in the order of the vocabulary.
        seed: decides sizes and times.
    """

    begin: int
    end: int
    stated: tuple[StatedBearing, ...]
    seed: int

    def record(self) -> list[dict[str, str]]:
        """Return what the manifest says."""
        return [{"name": each.name, **({"side": each.side} if each.side else {})} for each in self.stated]


def borne_spans(request: Request, fps: float, frames: int) -> list[BorneSpan]:
    """Return the parts of a motion whose prompts ask for bearings that fit their actions.

    None in streams, and in motions around kept frames.

    Args:
        request: of the motion; what a sequence says of its person holds for all its movements.
        fps: of the features.
        frames: of the features.
    """
    if request.kept or request.free or request.recording is not None:
        return []
    if request.timeline is None:
        stated = _fitting(stated_bearings(request.text.prompt), request.text)
        return [BorneSpan(0, frames, stated, request.seed)] if stated else []
    whole = [each for each in stated_bearings(request.text.prompt) if each.whole] if request.is_sequence else []
    found = []
    for k, row in enumerate(request.timeline):
        stated = _fitting([*whole, *stated_bearings(row.text.prompt)], row.text)
        if stated:
            end = min(round(row.end * fps), frames)
            found.append(BorneSpan(round(row.start * fps), end, stated, request.seed + k))
    return found


def _fitting(stated: Sequence[StatedBearing], text: TextFeatures) -> tuple[StatedBearing, ...]:
    """Return the bearings that the action of a prompt can have, each once, in the order of the vocabulary."""
    action = action_of(text) if stated else ""
    order = list(load_bearings())
    once = {each.name: each for each in stated if action and each.bearing.fits(action)}
    return tuple(sorted(once.values(), key=lambda each: order.index(each.name)))


def borne(motion: MotionFeatures, layout: FeatureLayout, spans: Sequence[BorneSpan]) -> Float32:
    """Return features (T, D) with the bearings of a motion drawn.

    Args:
        motion: as generated, in the layout's own units, on the skeleton of HumanML3D.
        layout: of the features.
        spans: by `borne_spans`.
    """
    features: Float32 = motion.features
    if not spans or len(features) < SHORTEST or layout.skeleton.name != HUMANML3D.name:
        return features
    joints = layout.decode(features).astype(np.float64)
    for span in spans:
        rng = np.random.default_rng([span.seed, span.begin])
        for each in span.stated:
            if each.bearing.gait:
                draw = limping if each.bearing.gait == "limp" else staggering
                joints = draw(joints, layout, span.begin, span.end, each.side, rng)
    body = StandingBody(joints)
    for stated, ways, rng in _drawn(spans, len(features), layout.fps):
        _Drawing(body, stated, ways, layout.fps, rng).draw()
    return encode_all(layout, body.solved())


def _drawn(
    spans: Sequence[BorneSpan], frames: int, fps: float
) -> Iterator[tuple[StatedBearing, Array, np.random.Generator]]:
    """Yield each bearing with how much of it there is, 0 to 1 (T,), in the order of the vocabulary."""
    names = {each.name: each for span in spans for each in span.stated}
    for name in sorted(names, key=list(load_bearings()).index):
        having = [span for span in spans if name in {each.name for each in span.stated}]
        rng = np.random.default_rng([having[0].seed, having[0].begin, len(name)])
        if names[name].bearing.gesture:
            for span in having:
                gestures = [each for each in span.stated if each.bearing.gesture]
                at = [each.name for each in gestures].index(name)
                yield gestures[at], _once(span, at, len(gestures), frames, fps, rng), rng
            continue
        held = np.zeros(frames)
        for span in having:
            held[span.begin : span.end] = 1.0
        yield names[name], np.clip(smooth(held, PASSES_S, fps), 0.0, 1.0), rng


def _once(span: BorneSpan, at: int, count: int, frames: int, fps: float, rng: np.random.Generator) -> Array:
    """Return how much of a gesture there is, 0 to 1 (T,): it is made in its share of the span."""
    bearing = [each.bearing for each in span.stated if each.bearing.gesture][at]
    begin, end = (span.begin + (span.end - span.begin) * share / count for share in (at, at + 1))
    seconds, rise, hold = (end - begin) / fps, bearing.raise_s, rng.uniform(*bearing.hold_s)
    fast = min(1.0, seconds / (rise * (1 + FALL) + 0.6 * hold))
    rise = rise * fast
    hold = min(hold, max(seconds - rise * (1 + FALL) - 2 * BEGINS_S, 0.5 * hold * fast))
    start = max(min(BEGINS_S, (seconds - rise * (1 + FALL) - hold) / 2), 0.0)
    return envelope(frames, begin / fps + start, rise, hold, FALL * rise)


class _Drawing:
    """One bearing that is drawn on a body."""

    def __init__(
        self, body: StandingBody, stated: StatedBearing, way: Array, fps: float, rng: np.random.Generator
    ) -> None:
        self._body, self._way, self._rng = body, way, rng
        self._bearing: Bearing = stated.bearing
        self._arms = arms_of(stated)
        self._time = np.arange(len(way)) / fps
        self._fps = fps
        self._size = float(rng.uniform(0.9, 1.1))

    def draw(self) -> None:
        """Draw it: trunk first, arms last."""
        bearing, way = self._bearing, self._way * self._size
        body = self._body
        if bearing.sink:
            body.shift(-bearing.sink * way)
        if bearing.trunk:
            body.bow(bearing.trunk * way, arms_hang=0.85, head=0.0)
        if bearing.heave:
            body.lean(bearing.heave * way * self._swung(bearing.heave_hz), "left")
        if bearing.roll:
            aside = self._swung(bearing.roll_hz) if bearing.roll_hz else self._steps()
            body.lean(bearing.roll * way * aside, "forward")
        if bearing.head:
            body.turn(NECK, "left", bearing.head * way)
        if bearing.tilt:
            side = self._rng.choice([-1.0, 1.0]) if not bearing.roll_hz else -self._swung(0.7 * bearing.roll_hz)
            body.turn(NECK, "forward", bearing.tilt * way * side)
        if bearing.shrug:
            body.shrug(bearing.shrug * way)
        if bearing.swing != 1.0:
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
        body.move_arm(side, self._way, *bones, lag=0.0, straight=True)

    def _move(self, side: str, pose: ArmPose) -> None:
        """Bring an arm to its pose."""
        body, (_, shoulder, elbow, wrist) = self._body, ARMS[side]
        if pose.hand is not None:
            place = self._place(side, pose.at)
            swung = np.sin(2 * np.pi * pose.hz * self._time + self._rng.uniform(0, 0.6))[:, None]
            target = body.from_shoulder(side, place) + np.array(pose.hand) + swung * np.array(pose.shake)
            upper, fore = body.reach(side, target, pose.elbow)
        else:
            upper, fore = (
                normalize(np.broadcast_to(np.asarray(wanted, np.float64), (len(body.joints), 3)))
                if wanted is not None
                else body.local(normalize(body.joints[:, b] - body.joints[:, a]), side)
                for wanted, a, b in ((pose.upper, shoulder, elbow), (pose.fore, elbow, wrist))
            )
        body.move_arm(side, pose.share * self._way, upper, fore, lag=0.0, straight=not self._bearing.gesture)

    def _place(self, side: str, at: str) -> Array:
        """Return the point (T, 3) that a hand's place is measured from."""
        joints = self._body.joints
        other = ARMS[OTHER_SIDE[side]]
        return {
            "chest": joints[:, [arm[1] for arm in ARMS.values()]].mean(1),
            "head": joints[:, HUMANML3D.index("head")],
            "hips": joints[:, 0],
            "shoulder": joints[:, ARMS[side][1]],
            "other-elbow": joints[:, other[2]],
            "other-hand": joints[:, other[3]],
        }[at]


def arms_of(stated: StatedBearing) -> Mapping[str, ArmPose]:
    """Return the poses of the arms by side.

    Where one arm acts, or both do the same, it is the side that the prompt names; else they are exchanged if it names
    the left, since poses of two arms act with the right one.
    """
    arms = stated.bearing.arms
    if not stated.side or stated.bearing.gait:
        return arms
    if len(arms) == 1:
        return {stated.side: next(iter(arms.values()))}
    if arms.get(LEFT) == arms.get(RIGHT):
        return {stated.side: arms[stated.side]} if arms else arms
    return {OTHER_SIDE[side]: pose for side, pose in arms.items()} if stated.side == LEFT else arms


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
