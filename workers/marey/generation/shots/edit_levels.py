"""Heights of new frames of an edit, and of the kept ones beside them: behind a climb, a motion goes on where it ended.

Each movement is made alone, on a floor at 0. Kept frames behind stairs would sink to that floor within their last step,
and those of a motion that has climbed stairs before would do so at the first new frame.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from marey.generation.shots.levels import CLIMBS, ENDS, FEET, LEAST_M, comes_down, lifted, passes_over
from marey.generation.wish import action_of
from marey.motion.features import FeatureLayout
from marey.motion.skeleton import HUMANML3D
from marey.text.features import TextFeatures

Float32 = NDArray[np.float32]

BESIDE = 20
"""Kept frames next to new ones by whose lowest foot the floor is told: who jumps comes down within them."""
_WRISTS, _HEAD = [20, 21], 15


@dataclass(frozen=True, eq=False)
class LevelledFrames:
    """New frames at the height where they are done.

    Attributes:
        features: (T, D).
        before, after: metres by which the kept frames on that side are higher than in their motion.
        floors: metres of the floor on which the new frames begin and end.
    """

    features: Float32 = field(repr=False)
    before: float = 0.0
    after: float = 0.0
    floors: tuple[float, float] = (0.0, 0.0)


def levelled(
    before: Float32, new: Float32, after: Float32, text: TextFeatures, layout: FeatureLayout, *, stay: bool = False
) -> LevelledFrames:
    """Return new frames at the height of the kept ones, and the height at which these go on behind a climb.

    Where new frames lead down by more than there is, the kept ones before them are raised, so that no floor lies
    below 0.

    Args:
        before: (a, D) features of the frames before; (0, D) = none.
        new: (T, D) of a motion alone, on a floor at 0.
        after: (b, D) of the frames after; (0, D) = none.
        text: of the prompt of the new frames.
        layout: of the features; on other skeletons than that of HumanML3D, all stay as they are.
        stay: the frames after keep their place, so nothing is raised but the new frames.
    """
    if layout.skeleton.name != HUMANML3D.name:
        return LevelledFrames(new)
    low, high = stands_at(before[-BESIDE:], layout), stands_at(after[:BESIDE], layout)
    said, actions = text.said.lower(), {action_of(each) for each in (text, *text.movements)}
    if not actions & CLIMBS:
        base = 0.0 if comes_down(said) else low if len(before) else high
        raised = lifted(new, base, layout) if base else new
        goes_on = not stay and len(before) > 0 and len(after) > 0
        return LevelledFrames(raised, 0.0, base - high if goes_on else 0.0, (base, base if goes_on else high))
    floor = _lowest_foot(new, layout)
    begins, ends = float(floor[:ENDS].min()), float(floor[-ENDS:].min())
    begins, ends = (each if each > LEAST_M else 0.0 for each in (begins, ends))
    is_over = action_of(text) == "climb-onto" and passes_over(said)
    way = 0.0 if is_over or abs(ends - begins) < LEAST_M else ends - begins
    base = low if stay else max(low, -way)
    top = base + way
    raised = lifted(new, base - begins, layout)
    if stay:
        return LevelledFrames(raised, floors=(base, high))
    return LevelledFrames(raised, base - low if len(before) else 0.0, top - high if len(after) else 0.0, (base, top))


def stands_at(features: Float32, layout: FeatureLayout) -> float:
    """Return how many metres over the floor at 0 a body of features (T, D) stands; 0 where it hangs, and of none."""
    if not len(features):
        return 0.0
    joints = layout.decode(features)
    hangs = np.median(joints[:, _WRISTS, 1].min(axis=1) - joints[:, _HEAD, 1]) > 0
    floor = float(joints[:, FEET, 1].min())
    return 0.0 if hangs or floor < LEAST_M else floor


def _lowest_foot(features: Float32, layout: FeatureLayout) -> NDArray[np.floating]:
    """Return the height (T,) of the lowest joint of the feet."""
    return layout.decode(features)[:, FEET, 1].min(axis=1)
