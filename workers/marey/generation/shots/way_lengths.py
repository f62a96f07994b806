"""Ways of sequences that are as long as is said: so many metres, or back to where they began.

Rows are made alone, and the transitions beside them take some of a way, or add to it. Here ways of rows are cut to what
is asked for as they are settled, and the joined motion is measured again, from standing to standing.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from marey.generation.distances import as_far, distance_of, frames_of_distance, passed_on
from marey.generation.port import Limits
from marey.generation.shots.going_on import is_onward, is_way
from marey.generation.shots.raised_arms import TURNING
from marey.generation.timed import CUT
from marey.generation.wish import action_of
from marey.motion.courses import course_of
from marey.motion.features import FeatureLayout
from marey.text.features import TextFeatures
from marey.vocabulary.counts import stated_count
from marey.vocabulary.distances import stated_distance

Float32 = NDArray[np.float32]

STARTS_S = 2.0
"""Seconds more of a way back than of one whose seconds are stated: it starts from rest, and is cut to its length."""
LEAST_S, GOES_ON_S = 3.5, 1.5
"""Seconds of a way of a sequence at least, and those that it loses to a fall, roll or throw out of its speed."""
_SHORT = re.compile(r"\b(?:steps?|paces|strides?|few|couple|bit|little|short|brief\w*|moment|inch\w*)\b", re.IGNORECASE)
AROUND = 150.0
"""Degrees of a turn from which on a way leads back."""
_BACK = re.compile(
    r"\b(?:walk|run|jog|stride|march|sprint|trot|stroll|head|go|goe|com|come|limp|rush|step|hurri|hurry|sneak|mov|move"
    r"|dash)(?:s|es|ing|n?ing)? (?:\w+ly )?back\b(?! (?:and forth|wards?))"
    r"|\b(?:returns?|returning)\b(?! (?:the|a|his|her|fire|it))"
    r"|\b(?:where|from where) (?:he|she|they|it) (?:had )?(?:started|began|begun|came|set off|was|were)\b"
    r"|\b(?:starting|original|initial|first) (?:point|place|position|spot|mark)\b",
    re.IGNORECASE,
)


@dataclass(frozen=True)
class WayRow:
    """A row of a sequence, for the lengths of its ways.

    Attributes:
        way: it goes ahead.
        turn: degrees by which a turn on the spot turns; 0 = none.
        metres: that the words name; None = none.
    """

    way: bool = False
    turn: float = 0.0
    metres: float | None = None


def ways_back(said: str, rows: Sequence[WayRow]) -> dict[int, int]:
    """Return the rows that lead back, each with the row of the way there, where a prompt says so.

    Args:
        said: the words of the whole prompt.
        rows: in their order.
    """
    if not _BACK.search(said):
        return {}
    found = dict[int, int]()
    for number, row in enumerate(rows):
        there = [k for k in range(number) if rows[k].way]
        turned = number > 0 and abs(rows[number - 1].turn) >= AROUND
        between = rows[there[-1] + 1 : number - 1] if there else ()
        if row.way and row.metres is None and turned and there and not any(each.turn for each in between):
            found[number] = there[-1]
    return found


def as_long_as(there: Float32, back: Float32, layout: FeatureLayout) -> tuple[Float32, Float32]:
    """Return features (T, D) of two ways of about the same length: the longer one ends sooner. The way back keeps what
    the transition to it takes, which is much of a run."""
    lengths = distance_of(there, layout), distance_of(back, layout)
    if lengths[1] >= lengths[0]:
        lost = float(passed_on(course_of(back, layout), layout.fps)[: CUT + 1][-1])
        cut = as_far(back, layout, min(lengths[0] + lost, lengths[1]))
        return there, back if cut is None else cut
    cut = as_far(there, layout, lengths[1])
    return (there if cut is None else cut), back


def metres_between(features: Float32, layout: FeatureLayout, begin: int, end: int) -> float:
    """Return the metres that a body goes between two frames of features (T, D)."""
    course = course_of(features, layout)
    return float(passed_on(course.at(np.arange(float(begin), end)), layout.fps)[-1])


def with_least_ways(
    movements: Sequence[TextFeatures], lengths: Sequence[int], limits: Limits, stated: Sequence[int | None]
) -> list[int]:
    """Return the frames of movements, of which ways are seen: they take some seconds, unless their words say how long
    they are, in seconds, metres or steps, or that they are short.

    Args:
        movements: in their order.
        lengths: frames of each.
        limits: of the model.
        stated: frames that the words state; None = they do not.
    """
    found = list(lengths)
    for number, each in enumerate(movements):
        action = action_of(each)
        if stated[number] is not None or not is_way(each) or _SHORT.search(each.said):
            continue
        if stated_distance(each.said, action) is not None or stated_count(each.said, action) is not None:
            continue
        onward = number + 1 < len(movements) and is_onward(each, movements[number + 1])
        least = LEAST_S + GOES_ON_S * onward
        found[number] = max(found[number], limits.within(round(least * limits.fps)))
    return found


def with_room_back(
    said: str,
    movements: Sequence[TextFeatures],
    lengths: Sequence[int],
    limits: Limits,
    stated: Sequence[int | None],
) -> list[int]:
    """Return the frames of movements, of which ways back have as much room as those there.

    Args:
        said: the words of the whole prompt.
        movements: in their order.
        lengths: frames of each.
        stated: those of them that the words state; None = they do not.
        limits: of the model.
    """
    actions = [action_of(each) for each in movements]
    rows = [
        WayRow(is_way(each), AROUND * (action in TURNING), stated_distance(each.said, action))
        for each, action in zip(movements, actions, strict=True)
    ]
    found = list(lengths)
    for number, there in ways_back(said, rows).items():
        metres = rows[there].metres
        far = None if metres is None else frames_of_distance(metres, actions[number], limits)
        room = found[there] + round(STARTS_S * limits.fps) * (stated[there] is not None)
        found[number] = max(found[number], far or room)
    return found
