"""Ways that go on where a network turns them back.

Asked for some seconds of a walk, a network often goes ahead and then backward, as the takes that it learned from. Such
a way is kept as long as it goes ahead, and goes on with strides of its own.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from marey.motion.courses import Course, course_of, gradient
from marey.motion.curves import smooth_open
from marey.motion.features import FeatureLayout
from marey.motion.rotations import Array

Float32 = NDArray[np.float32]

BACK, AHEAD = 100.0, 35.0
"""Degrees between where a body goes and where it faces, from which on it goes back, and up to which it goes ahead."""
GOES = 0.3
"""Metres a second from which a body has a direction."""
BACK_S, AHEAD_S = 0.3, 1.4
"""Seconds of a way back at least, and of the way ahead that goes on."""
STEADY = 0.85
"""Share of the median speed of a way at which it goes on."""
STRIDES_S, RUN_S, LATEST_S = (0.95, 2.3), 0.6, 0.8
"""Bounds of the seconds of strides that are made again, the least of a run, and in how many at the end they end."""
RUNS = 1.9
"""Metres a second of a run."""
FADES = 3
"""Frames in which one round of strides passes into the next."""
TREND_S = 0.2
"""Standard deviation in seconds of the smoothing of a direction."""


def without_return(features: Float32, layout: FeatureLayout) -> Float32 | None:
    """Return features (T, D) of a way that goes ahead all the time; None if it does so by itself, or hardly at all.

    Args:
        features: (T, D) of a forward gait, in the layout's own units.
        layout: of the features.
    """
    course = course_of(features, layout)
    aside, speeds = _aside(course, layout.fps), course.speeds(layout.fps)
    back = np.flatnonzero((aside > BACK) & (speeds > GOES))
    if len(back) < BACK_S * layout.fps:
        return None
    ahead = np.flatnonzero(_steady(aside[: back[0]], speeds[: back[0]]))
    if not len(ahead) or ahead[-1] < AHEAD_S * layout.fps:
        return None
    return gone_on_with_strides(features[: ahead[-1] + 1], layout, len(features))


def _steady(aside: Array, speeds: Array) -> NDArray[np.bool_]:
    """Return the frames (T,) in which a body goes ahead at its speed."""
    goes = speeds[speeds > GOES]
    least = STEADY * float(np.median(goes)) if len(goes) else np.inf
    return (aside < AHEAD) & (speeds >= least)


def _aside(course: Course, fps: float) -> Array:
    """Return the degrees (T,), from 0 to 180, between where a body goes and where it faces."""
    steps = smooth_open(gradient(course.places), TREND_S * fps)
    apart = np.arctan2(steps[:, 0], steps[:, 1]) - course.headings
    return np.abs(np.degrees((apart + np.pi) % (2 * np.pi) - np.pi))


def steady_part(features: Float32, layout: FeatureLayout) -> Float32:
    """Return features (T', D) of a way up to the last moment at which it goes ahead at its speed."""
    course = course_of(features, layout)
    steady = np.flatnonzero(_steady(0.0 * course.headings, course.speeds(layout.fps)))
    return features[: steady[-1] + 1] if len(steady) and steady[-1] >= AHEAD_S * layout.fps else features


def gone_on_with_strides(features: Float32, layout: FeatureLayout, frames: int) -> Float32 | None:
    """Return features (frames, D) of a way whose last strides are made over and over; None if no two of its moments are
    alike.

    Args:
        features: (T, D), T less than `frames`.
        layout: of the features.
        frames: of the whole.
    """
    fps, count = layout.fps, len(features)
    least = RUN_S if np.median(course_of(features, layout).speeds(fps)) > RUNS else STRIDES_S[0]
    local = np.concatenate([features[:, layout.slices[name]] for name in ("positions", "velocities")], axis=1)
    spread = np.maximum(local.std(axis=0), 0.02)
    ends = range(max(count - round(LATEST_S * fps), 2), count - FADES)
    pairs = [
        (float(np.abs((local[end] - local[begin]) / spread).mean()), begin, end)
        for end in ends
        for begin in range(max(end - round(STRIDES_S[1] * fps), 1), end - round(least * fps) + 1)
    ]
    if not pairs:
        return None
    _, begin, end = min(pairs)
    weight = (np.arange(1, FADES + 1) / (FADES + 1))[:, None]
    passing = (1 - weight) * features[end : end + FADES] + weight * features[begin : begin + FADES]
    strides = np.concatenate([passing, features[begin + FADES : end]]).astype(features.dtype)
    rounds = -(-(frames - end) // len(strides))
    return np.concatenate([features[:end], *([strides] * max(rounds, 0))])[:frames]
