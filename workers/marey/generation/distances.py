"""Ways that are as long as their prompt says: "walks five metres".

A network walks for some seconds, however far. Of its way so much is kept as is asked for, to a moment at which both
feet are down where there is one near, and its strides are made a little longer or shorter, as its course is.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from marey.generation.onward import gone_on_with_strides, steady_part
from marey.generation.port import Limits
from marey.generation.steered import steered_features
from marey.generation.turned import bent_along
from marey.motion.courses import Course, course_of, natural_course
from marey.motion.curves import smooth_open
from marey.motion.features import FeatureLayout, encode_all
from marey.motion.feet import find_contacts
from marey.motion.paced_features import pace_features
from marey.motion.rotations import Array
from marey.selector.motion import SHORTEST
from marey.vocabulary.courses import WayCourse

Float32 = NDArray[np.float32]

SPEEDS = {"walk": 1.1, "run": 2.5, "sprint": 4.4, "walk-backward": 0.9, "sneak": 0.55, "carry": 0.95}
"""Metres a second of ways as networks make them, about; of other ways they are not made."""
SPARE_S = 1.0
"""Seconds more than that takes that a network is asked for."""
MOST_S, WALKS_S = {"run": 4.5, "sprint": 4.5}, 7.0
"""Seconds that a network is asked for at most: in longer ones, it stands, slows down or turns back; of other ways."""
SCALED, PLAYED = (0.8, 1.25), (0.65, 1.45)
"""Bounds of how many times as long strides are made, and how many times as fast they are played."""
NEAR = 0.02
"""Share by which a way may differ."""
UNEVEN = 0.04
"""How much rather a way ends with both feet down: as much as strides that differ by this share more."""
LEAST_MADE = 3.0
"""Metres that a way goes at least by itself whose strides are made again."""
EASES_S = 0.2
"""Standard deviation in seconds over which strides become longer or shorter."""


def frames_of_distance(metres: float, action: str, limits: Limits, fixed: int | None = None) -> int | None:
    """Return the frames in which a network goes so far; None if it is not asked for more than usual.

    Args:
        metres: of the way.
        action: its id.
        limits: of the model.
        fixed: frames that the way has to fill; None = as many as it takes.
    """
    if action not in SPEEDS:
        return None
    usual = metres / SPEEDS[action] * limits.fps
    if fixed is None:
        return limits.within(round(min(usual + SPARE_S * limits.fps, MOST_S.get(action, WALKS_S) * limits.fps)))
    return limits.within(round(fixed * float(np.clip(usual / fixed, 1.0, PLAYED[1]))))


def as_far(features: Float32, layout: FeatureLayout, metres: float, fixed: int | None = None) -> Float32 | None:
    """Return features (T', D) of a way that goes so far; None if it cannot.

    Args:
        features: (T, D), in the layout's own units.
        layout: of the features.
        metres: that it is to go.
        fixed: frames that it fills; None = as many as it takes.
    """
    passed = passed_on(course_of(features, layout), layout.fps)
    counts = np.arange(SHORTEST, len(features) + 1)
    if not len(counts):
        return None
    scales = metres / np.maximum(passed[counts - 1], 1e-6)
    cost = np.abs(np.log(scales))
    allowed = (scales > SCALED[0]) & (scales < SCALED[1])
    if fixed is None:
        stands = find_contacts(layout.decode(features).astype(np.float64), layout.skeleton, layout.fps)
        cost += UNEVEN * ~(stands[counts - 1, :2].any(axis=1) & stands[counts - 1, 2:].any(axis=1))
    else:
        rates = counts / fixed
        allowed &= (rates > PLAYED[0]) & (rates < PLAYED[1])
        cost += np.abs(np.log(rates))
    if not allowed.any():
        return None
    count = int(counts[allowed][cost[allowed].argmin()])
    far = with_distance(features[:count], layout, [(0, count, metres)])
    return far if fixed in (None, count) else pace_features(far, layout.slices, fixed)


def farther(features: Float32, layout: FeatureLayout, metres: float, most: int) -> Float32 | None:
    """Return features (T', D) of a way that goes farther than a network does at once, with strides of its own; None if
    it cannot.

    Args:
        features: (T, D), in the layout's own units.
        layout: of the features.
        metres: that it is to go.
        most: frames at most.
    """
    features = steady_part(features, layout)
    made = distance_of(features, layout)
    frames = round(len(features) * metres / max(made, 1e-6) + layout.fps)
    if made < LEAST_MADE or frames > most or frames <= len(features):
        return None
    longer = gone_on_with_strides(features, layout, frames)
    straight = None if longer is None else steered_features(longer, layout, WayCourse(), 0)
    longer = longer if straight is None else straight
    return None if longer is None else as_far(longer, layout, metres)


def with_distance(features: Float32, layout: FeatureLayout, spans: list[tuple[int, int, float]]) -> Float32:
    """Return features (T, D) whose strides are longer or shorter between some frames, so that the body goes as far as
    is said there.

    Args:
        features: in the layout's own units.
        layout: of the features.
        spans: first frame, the one after the last, and metres.
    """
    joints = layout.decode(features).astype(np.float64)
    natural = natural_course(joints, layout.skeleton, layout.fps)
    scales = np.ones(len(joints))
    for begin, end, metres in spans:
        made = passed_on(natural.at(np.arange(float(begin), end)), layout.fps)[-1]
        scale = float(np.clip(metres / max(made, 1e-6), *SCALED))
        if abs(metres / max(made, 1e-6) - 1.0) > NEAR:
            scales[begin:end] = scale
    if np.all(scales == 1.0):
        return features
    scales = smooth_open(scales[:, None], EASES_S * layout.fps)
    steps = np.diff(natural.places, axis=0) * 0.5 * (scales[1:] + scales[:-1])
    places = natural.places[0] + np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
    return encode_all(layout, bent_along(joints, layout, natural, Course(places, natural.headings)))


def passed_on(course: Course, fps: float) -> Array:
    """Return the metres (T,) that a body has gone along a course: from where it began where the way is about straight,
    so that its sway does not count."""
    places = smooth_open(course.places, EASES_S * fps)
    passed = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(places, axis=0), axis=1))])
    straight = np.linalg.norm(places - places[0], axis=1)
    return straight if straight[-1] > 0.9 * passed[-1] else passed


def distance_of(features: Float32, layout: FeatureLayout) -> float:
    """Return the metres that a body goes in features (T, D), to two digits."""
    return round(float(passed_on(course_of(features, layout), layout.fps)[-1]), 2)
