"""The poses of bearings, drawn on a motion: trunk, head, hips and arms, and the gaits that they go in."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from marey.generation.bearing import BorneSpan
from marey.generation.bearing_times import BearingAmounts, amounts_of_bearings
from marey.generation.gaits import GAITS, stomping
from marey.generation.leans import trunk_shares
from marey.generation.overhead import overhead
from marey.generation.port import MotionFeatures
from marey.motion.features import FeatureLayout, encode_all
from marey.motion.filters import smooth_seconds
from marey.motion.rotations import normalize
from marey.motion.skeleton import HUMANML3D
from marey.posing.standing import ARMS, LEFT, LEGS, NECK, OTHER_SIDE, RIGHT, StandingBody, way_through
from marey.vocabulary.bearings import (
    ArmPose,
    Bearing,
    Gait,
    Keys,
    StatedBearing,
    Vector,
)

Array = NDArray[np.floating]
Float32 = NDArray[np.float32]
_LEG_JOINTS = [joint for leg in LEGS.values() for joint in leg]
_ONE_FOOT = re.compile(r"\bfoot\b")
SOBS = 0.5
"""Degrees by which the head shakes for each one by which sobbing shoulders rise."""
PLANTS, PLANT_UP = (-0.22, 0.3), 0.6
"""Metres by which a hand on a cane goes back and ahead of its place at most, and share of the height of the foot by
which it is lifted on its way."""
SWING_S = 0.5
"""The same of the filter that leaves an arm's way and takes out its swing."""
UPPER_STEPS = 0.02
"""Metres a frame by which the feet pass each other in a walk that rolls in full."""
SEATED_SHARE = 0.7
"""Share of the lean of a standing trunk that one has that does not lean from the hips."""
KEYED_S = 0.06
"""Standard deviation of the filter of ways through keys, seconds: they pass without a halt."""
FOLDS = 1.8
"""By how much an arm folds before it makes strokes: a hand that reaches past its place looks like one more knock."""
AHEAD = ("shoulder", "chest")
"""Places that hands are measured from which they come to from below."""
SHORTEST = 10
"""Frames of the shortest motion on which anything is drawn."""


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
    shares = trunk_shares(span.stated for span in spans)
    drawings = [
        _Drawing(body, each, amounts, layout.fps, rng, shares.get(each.name, 1.0))
        for each, amounts, rng in amounts_of_bearings(spans, len(features), layout.fps)
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


class _Drawing:
    """One bearing that is drawn on a body."""

    def __init__(
        self,
        body: StandingBody,
        stated: StatedBearing,
        ways: BearingAmounts,
        fps: float,
        rng: np.random.Generator,
        share: float = 1.0,
    ) -> None:
        self._body, self._ways, self._rng, self._share = body, ways, rng, share
        self._bearing: Bearing = overhead(stated.bearing) if stated.is_overhead else stated.bearing
        self._arms = arms_of(stated, self._bearing)
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
        moves = np.gradient(smooth_seconds(apart, 0.05, self._fps))
        return np.clip(moves / max(float(np.percentile(np.abs(moves), 85)), UPPER_STEPS), -1.0, 1.0)

    def _swing(self, side: str) -> None:
        """Make the swing of an arm smaller or larger."""
        body, (_, shoulder, elbow, wrist) = self._body, ARMS[side]
        bones = []
        for a, b in ((shoulder, elbow), (elbow, wrist)):
            here = body.local(normalize(body.joints[:, b] - body.joints[:, a]), side)
            calm = smooth_seconds(here, SWING_S, self._fps)
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
        return smooth_seconds(np.stack([np.zeros_like(ahead), up, ahead], axis=-1), 0.05, self._fps)

    def _keyed(self, values: Sequence[float] | Sequence[Vector]) -> Array:
        """Return numbers (T,), or points (T, 3), that are `values` at the times of the keys; 0 if there are none."""
        frames = len(self._time)
        if not values or self._bearing.keys is None:
            return np.zeros(frames)
        times = self._bearing.keys.times
        if self._done is None:
            at = (self._pace * self._time + self._begins) % times[-1]
            return smooth_seconds(way_through(at, times, values), KEYED_S, self._fps)
        again = times[-1] + self._bearing.returns_s
        rounds = [number * again + np.array(times) for number in range(self._times)]
        points = np.concatenate([np.asarray(values, np.float64)] * self._times)
        return smooth_seconds(way_through(self._done, np.concatenate(rounds), points), KEYED_S, self._fps)

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


def arms_of(stated: StatedBearing, bearing: Bearing | None = None) -> Mapping[str, ArmPose]:
    """Return the poses of the arms by side, of a `bearing` in place of the stated one if it is given.

    Where one arm acts, or both do the same, it is the side that the prompt names; else they are exchanged if it names
    the left, since poses of two arms act with the right one.
    """
    arms, side = (bearing or stated.bearing).arms, stated.acts
    if not side or stated.bearing.gait:
        return arms
    if len(arms) == 1:
        return {side: next(iter(arms.values()))}
    if arms.get(LEFT) == arms.get(RIGHT):
        return {side: arms[side]} if arms else arms
    return {OTHER_SIDE[one]: pose for one, pose in arms.items()} if side == LEFT else arms
