"""Walks and runs that go on into each other.

Each movement of a sequence is made alone, so a walk may come to rest at its end, and the run after it begin from
standing. Between two of them such frames are left out.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from marey.generation.onward import gone_on_with_strides
from marey.generation.wish import action_of
from marey.motion.courses import course_of
from marey.motion.features import FeatureLayout
from marey.motion.rotations import Array
from marey.selector.matching import wanted_of
from marey.text.features import TextFeatures
from marey.vocabulary.bearing_words import stated_bearings
from marey.vocabulary.courses import ASIDE, QUARTER, RUNS, STRAIGHT, WAYS, stated_course
from marey.vocabulary.gazes import without_gaze
from marey.vocabulary.in_place import goes_in_place
from marey.vocabulary.stops import stated_skid

Float32 = NDArray[np.float32]

GOES_ON = WAYS | {"leap"}
"""Actions of a body that may go on from them into the next one: who leaps runs up and on."""
PASSES, PASSES_OVER = frozenset({"climb-onto"}), frozenset({"step-over"})
"""Actions, and names of movements, that are drawn as a way over something: a vault, and a step."""
LANDS = PASSES | {"leap", "jump", "jump-forward", "jump-turn", "flip", "cartwheel"}
ROLLING = frozenset({"roll"})
"""Drawn actions that end on the feet out of the air, or off the hands, and those that go on out of such a landing."""
FALLING, THROWING = frozenset({"die", "roll"}), frozenset({"throw"})
"""Actions that go on out of the speed of a way, and of a run."""
GOING = 0.7
"""Share of its median speed under which a way begins or ends."""
MOST_S, LEAST_S = 1.5, 1.0
"""Seconds that are left out at most, and left at least."""
WAITS_S = 0.4
"""Seconds before the first way at most."""


def is_way(text: TextFeatures) -> bool:
    """Return True if a text asks for a walk, a run or a leap ahead, and for nothing else."""
    if goes_in_place(text.said, "walk") or stated_skid(text.said, action_of(text)):
        return False
    steps = wanted_of(text.actions or (text.rewritten,)) or ()
    return len(steps) == 1 and {each.action for each in steps[0]} <= GOES_ON


def passes_over(text: TextFeatures) -> bool:
    """Return True if a drawn movement is a way over something, which goes on into the next way."""
    return action_of(text) in PASSES or any(each.name in PASSES_OVER for each in stated_bearings(text.said))


def rolls_landing(before: TextFeatures, after: TextFeatures) -> bool:
    """Return True if a drawn roll goes on out of the landing of the drawn movement before it."""
    return action_of(before) in LANDS and action_of(after) in ROLLING


def is_onward(before: TextFeatures, after: TextFeatures) -> bool:
    """Return True if a drawn movement goes out of the speed of the way before it."""
    action = action_of(after)
    return is_way(before) and (action in FALLING or (action in THROWING and action_of(before) in RUNS))


def without_halt(before: Float32, after: Float32, layout: FeatureLayout) -> tuple[Float32, Float32]:
    """Return features (T, D) of two ways without the slow end of the first and the slow beginning of the second."""
    ends, begins = (course_of(features, layout).speeds(layout.fps) for features in (before, after))
    return before[: len(before) - _slow(ends[::-1], layout.fps)], after[_slow(begins, layout.fps) :]


def as_long_as_stated(features: Float32, layout: FeatureLayout, frames: int) -> Float32:
    """Return features (T, D) of a way whose seconds the words state: what was left out beside other ways is made up for
    with strides of its own."""
    if len(features) >= frames:
        return features
    longer = gone_on_with_strides(features, layout, frames)
    return features if longer is None else longer


def aside_of(text: TextFeatures) -> float:
    """Return the degrees by which a way goes off to a side, positive to the left; 0 if it does not."""
    course = stated_course(without_gaze(text.said), action_of(text))
    if course is None or course.kind != ASIDE:
        return 0.0
    return QUARTER if course.side == "left" else -QUARTER


def keeps_course(before: TextFeatures, text: TextFeatures) -> bool:
    """Return True if a text asks for a way straight on from where the body faces before it, or off to a side."""
    course = stated_course(without_gaze(text.said), action_of(text))
    return is_way(text) and course is not None and course.kind in (STRAIGHT, ASIDE) and not is_way(before)


def without_wait(features: Float32, layout: FeatureLayout) -> Float32:
    """Return features (T, D) of a way with which a sequence begins, without a wait in the middle of a stride: it keeps
    the last moment before it goes."""
    slow = _slow(course_of(features, layout).speeds(layout.fps), layout.fps)
    return features[max(slow - round(WAITS_S * layout.fps), 0) :]


def _slow(speeds: Array, fps: float) -> int:
    """Return how many of the first frames are slow."""
    goes = np.flatnonzero(speeds >= GOING * np.median(speeds))
    return max(min(int(goes[0]), round(MOST_S * fps), len(speeds) - round(LEAST_S * fps)), 0)
