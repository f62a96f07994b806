"""Runs that set off from a stand, and come to one, at the pace at which a body can.

Each movement of a sequence is made alone, so a run is at full speed where the stand before it ends, and still is where
the stand behind it begins; the transition between them would throw the body forward within a few frames. Here its first
and last strides are slower and shorter, so that the speed grows and falls evenly.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from marey.generation.distances import NEAR, distance_of, with_distance
from marey.generation.onward import gone_on_with_strides, steady_part
from marey.generation.shots.going_on import is_way
from marey.generation.shots.strands import RowStrand
from marey.generation.shots.timeline_plan import TimelinePart
from marey.generation.steered import steered_features
from marey.generation.timed import cut_of
from marey.generation.turned import bent_along
from marey.generation.wish import action_of
from marey.motion.courses import Course, course_of, natural_course
from marey.motion.curves import smooth_open
from marey.motion.features import FeatureLayout, encode_all
from marey.motion.resample import interpolate
from marey.motion.rotations import Array
from marey.quality.limits import assess, expected_by_prompts
from marey.quality.record import Flag
from marey.vocabulary.courses import STRAIGHT, WayCourse, stated_course

Float32 = NDArray[np.float32]

ACCELERATES = 4.0
"""Metres a second by which a body is faster or slower after a second."""
JOINS = 1.5
"""Metres a second by which it may be faster or slower behind a transition than before it."""
JOINS_FAR = 0.5
"""The same of ways of stated metres, in whose transitions no step is made shorter (`with_even_speed`)."""
LEAST = 0.8
"""Metres a second of a difference that is still left to a transition."""
SLOWER = 0.6
"""Share of what a stride loses in speed that it loses in pace; the rest, in length."""
SLOWEST, SHORTEST = 0.45, 0.5
"""Least pace, and least length, of a stride, as shares of its own."""
CHANGES, REACH_S, LEAST_STEP = (3.0, 3.5, 4.0, 4.8, 6.0), 1.2, 0.25
"""Metres a second by which the speed beside a transition changes in a second at most, of which the first is taken that
leaves the motion as sound as it was; the seconds beside it in which that is looked at; and the share of a step that is
left at least."""
OWN_S, EASES_S = 0.08, 0.05
"""Standard deviations of the filters of the path that is looked at there, and of the shares of its steps, seconds."""
LEAST_S = 1.0
"""Seconds of a way that is looked at."""
TRIES = 3
"""How often strides are added to a way of stated metres."""
BESIDE_S = 0.25
"""Seconds at the end of a movement whose speed is that with which it ends."""


@dataclass(frozen=True)
class Beside:
    """Speeds of the movements beside a way, metres a second; None = there is none, or it goes on by itself.

    Attributes:
        before, after: how fast they end and begin.
        replaced: frames at the beginning of the way that a transition replaces.
        joins: metres a second by which the way may be faster than what is beside it.
    """

    before: float | None
    after: float | None
    replaced: int
    joins: float = JOINS


def end_speeds(features: Float32, layout: FeatureLayout) -> tuple[float, float]:
    """Return the metres a second at which a motion of features (T, D) begins and ends."""
    speeds, few = course_of(features, layout).speeds(layout.fps), max(round(BESIDE_S * layout.fps), 1)
    return float(speeds[:few].mean()), float(speeds[-few:].mean())


def set_off(rows: Sequence[RowStrand], layout: FeatureLayout, *, fixed: bool) -> None:
    """Let ways set off from the speed of the row before them, and slow down to that of the row behind. A way whose
    metres are stated has as many strides more as it takes to go so far, where its length is free.

    Args:
        rows: of a sequence, in their order.
        layout: of their features.
        fixed: all rows keep their length.
    """
    for number, row in enumerate(rows):
        metres = row.as_way(layout).metres
        keeps = fixed or not row.open
        if row.features is None or not _is_made_way(row) or (metres is not None and (keeps or _is_bent(row))):
            continue
        before = rows[number - 1] if number and not _goes_on(row) else None
        after = rows[number + 1] if number + 1 < len(rows) and not _goes_on(rows[number + 1]) else None
        beside = Beside(
            None if before is None or before.features is None else end_speeds(before.features, layout)[1],
            None if after is None or after.features is None else end_speeds(after.features, layout)[0],
            cut_of(len(row.features)),
        )
        if metres is None:
            off = setting_off(row.features, layout, beside, len(row.features) if keeps else None)
        else:
            off = setting_off_as_far(row.features, layout, beside, metres)
        row.features = row.features if off is None else off


def _is_made_way(row: RowStrand) -> bool:
    """Return True if a row is a way that the model made."""
    return is_way(row.text) and not row.is_drawn


def _is_bent(row: RowStrand) -> bool:
    """Return True if the words tell a way that is not straight."""
    course = stated_course(row.text.said, action_of(row.text))
    return course is not None and course.kind != STRAIGHT


def _goes_on(row: RowStrand) -> bool:
    """Return True if no transition leads to a row."""
    return bool(row.entered) or row.held.meets


def setting_off(features: Float32, layout: FeatureLayout, beside: Beside, frames: int | None = None) -> Float32 | None:
    """Return features (T', D) of a way whose first and last strides lead from the speed of what is beside it to its
    own; None if they do.

    Args:
        features: (T, D), in the layout's own units.
        layout: of the features.
        beside: it.
        frames: that it keeps, the farther end being left out; None = as many as it takes.
    """
    joints = layout.decode(features).astype(np.float64)
    if len(joints) < LEAST_S * layout.fps:
        return None
    strides = _Strides(joints, layout, beside)
    if not strides.change:
        return None
    if frames is not None:
        more = len(strides.times()) - frames
        trimmed = joints[more:] if beside.before is None else joints[: len(joints) - more]
        if more and len(trimmed) < LEAST_S * layout.fps:
            return None
        strides = _Strides(trimmed, layout, beside) if more else strides
    return encode_all(layout, strides.played(frames))


def setting_off_as_far(features: Float32, layout: FeatureLayout, beside: Beside, metres: float) -> Float32 | None:
    """Return features (T', D) of a way of so many metres whose first and last strides lead from the speed of what is
    beside it to its own; None if they do, or it cannot go on for what they are shorter.

    Args:
        features: (T, D), in the layout's own units.
        layout: of the features.
        beside: it.
        metres: that it goes.
    """
    beside = replace(beside, joins=JOINS_FAR)
    off = setting_off(features, layout, beside)
    steady = steady_part(features, layout)
    step = distance_of(steady, layout) / len(steady)
    for _ in range(TRIES):
        if off is None or distance_of(off, layout) >= (1 - NEAR) * metres:
            break
        frames = len(features) + round((metres - distance_of(off, layout)) / max(step, 1e-6))
        longer = gone_on_with_strides(steady, layout, frames)
        straight = None if longer is None else steered_features(longer, layout, WayCourse(), 0)
        longer = longer if straight is None else straight
        off = None if longer is None else setting_off(longer, layout, beside)
    return None if off is None else with_distance(off, layout, [(0, len(off), metres)])


def with_even_speed(
    features: Float32, layout: FeatureLayout, rows: Sequence[RowStrand], transitions: Sequence[TimelinePart]
) -> Float32:
    """Return features (T, D) of a sequence with shorter steps where transitions beside ways throw the body forward or
    hold it up; not beside one whose metres are stated, which set off and slow down by strides of their own.

    Args:
        features: in the layout's own units.
        layout: of the features.
        rows: of the sequence, in their order.
        transitions: between them.
    """
    free = [row.as_way(layout).metres is None for row in rows]
    pairs = zip(transitions, pairwise(rows), pairwise(free), strict=True)
    joined = [
        (part.start, part.end)
        for part, pair, are_free in pairs
        if all(are_free) and any(map(_is_made_way, pair)) and not _goes_on(pair[1])
    ]
    expected = expected_by_prompts([row.text.said for row in rows])

    def flags(motion: Float32) -> set[Flag]:
        return set(assess(layout.decode(motion), layout.fps, expected).flags)

    known = flags(features) if joined else set[Flag]()
    for begin, end in joined:
        for most in CHANGES:
            tried = _evened(features, layout, (begin, end), most)
            if tried is None:
                break
            if flags(tried) <= known:
                features = tried
                break
    return features


def _evened(features: Float32, layout: FeatureLayout, joined: tuple[int, int], most: float) -> Float32 | None:
    """Return features (T, D) whose speed changes by no more than `most` metres a second in a second beside a
    transition; None if it does not."""
    joints, fps = layout.decode(features).astype(np.float64), layout.fps
    own = natural_course(joints, layout.skeleton, fps)
    places = smooth_open(joints[..., [0, 2]].mean(axis=1), OWN_S * fps)
    speeds = np.linalg.norm(np.gradient(places, axis=0), axis=1) * fps
    even, reach = speeds.copy(), round(REACH_S * fps)
    first, last = max(joined[0] - reach, 0), min(joined[1] + reach, len(even))
    slowest = first + int(even[first:last].argmin())
    even[slowest:last] = _gaining(even[slowest:last], most / fps)
    even[first : slowest + 1] = _gaining(even[first : slowest + 1][::-1], most / fps)[::-1]
    shares = np.clip(even / np.maximum(speeds, 1e-6), LEAST_STEP, 1.0)
    if np.all(shares == 1.0):
        return None
    return encode_all(layout, _shorter(joints, layout, Course(places, own.headings), shares))


def _gaining(speeds: Array, most: float) -> Array:
    """Return speeds (T,) that grow by no more than `most` a frame."""
    even = speeds.copy()
    for frame in range(1, len(even)):
        even[frame] = min(even[frame], even[frame - 1] + most)
    return even


def _shorter(joints: Array, layout: FeatureLayout, natural: Course, shares: Array) -> Array:
    """Return joints (T, 22, 3) of a way whose steps keep so large a share (T,) of their length."""
    shares = smooth_open(shares[:, None], EASES_S * layout.fps)
    steps = np.diff(natural.places, axis=0) * 0.5 * (shares[1:] + shares[:-1])
    places = natural.places[0] + np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
    return bent_along(joints, layout, natural, Course(places, natural.headings))


class _Strides:
    """Strides of a way that become slower and shorter towards its ends.

    Attributes:
        paces, lengths: shares (T,) of the pace and the length of its strides that each frame keeps.
    """

    def __init__(self, joints: Array, layout: FeatureLayout, beside: Beside) -> None:
        self.joints, self.layout = joints, layout
        self.natural = natural_course(joints, layout.skeleton, layout.fps)
        speeds = self.natural.speeds(layout.fps)
        self.paces, self.lengths = np.ones((2, len(joints)))
        if beside.before is not None:
            paces, lengths = _passage(speeds, beside.before, beside.replaced, beside.joins, layout.fps)
            self.paces, self.lengths = np.minimum(self.paces, paces), np.minimum(self.lengths, lengths)
        if beside.after is not None:
            paces, lengths = _passage(speeds[::-1], beside.after, 0, beside.joins, layout.fps)
            self.paces, self.lengths = np.minimum(self.paces, paces[::-1]), np.minimum(self.lengths, lengths[::-1])

    @property
    def change(self) -> bool:
        """True if any stride becomes slower."""
        return bool(self.paces.min() < 1.0)

    def times(self, frames: int | None = None) -> Array:
        """Return the frames of the way that are played."""
        played = np.concatenate([[0.0], np.cumsum(1.0 / self.paces)[:-1]])
        count = int(played[-1]) + 1 if frames is None else frames
        at = np.arange(count) if frames is None else np.linspace(0.0, played[-1], count)
        return np.interp(at, played, np.arange(len(played)))

    def played(self, frames: int | None) -> Array:
        """Return joints (T', 22, 3) in which it is done."""
        joints = _shorter(self.joints, self.layout, self.natural, self.lengths)
        return interpolate(joints, self.times(frames))


def _passage(speeds: Array, beside: float, replaced: int, joins: float, fps: float) -> tuple[Array, Array]:
    """Return the paces and the lengths (T,) of strides at so many metres a second (T,) whose first ones lead out of
    another speed."""
    paces, lengths = np.ones((2, len(speeds)))
    if abs(float(speeds[min(replaced, len(speeds) - 1)]) - beside) < LEAST + JOINS:
        return paces, lengths
    at, count, played, shares = 0.0, 0, list[float](), list[tuple[float, float]]()
    while at < len(speeds) - 1:
        own = float(np.interp(at, np.arange(len(speeds)), speeds))
        most = beside + joins + ACCELERATES * max(count - replaced, 0) / fps
        if most >= own and count >= replaced:
            break
        share = min(most / max(own, 1e-6), 1.0)
        pace = max(share**SLOWER, SLOWEST)
        played.append(at)
        shares.append((pace, float(np.clip(share / pace, SHORTEST, 1.0))))
        at, count = at + pace, count + 1
    if not played:
        return paces, lengths
    frames = np.arange(len(speeds))
    ends = [*played, at]
    return tuple(np.interp(frames, ends, [*each, 1.0]) for each in zip(*shares, strict=True))  # type: ignore[return-value]
