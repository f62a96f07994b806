"""Length of a motion whose prompt names none: that of the model, or as long as what is drawn on it takes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from marey.generation.asked import draws_bearings
from marey.generation.bearing import fitting
from marey.generation.done import BEGINS_S, done_s, feet_s
from marey.generation.port import Generator, Request
from marey.generation.wish import action_of
from marey.text.features import TextFeatures
from marey.vocabulary.bearing_words import stated_bearings

WORK_S = 5.0
"""Seconds of work at least, two rounds of the longest, and of what has an end, such as a phone call."""


def resolved_length(generator: Generator[Any], request: Request) -> Request:
    """Return a request with its length set, where the model decides lengths beforehand.

    Raises:
        InvalidInput: as `Limits.check`.
    """
    resolved = generator.resolve_length(request)
    if request.frames is not None or resolved.frames is None or not draws_bearings(generator, request):
        return resolved
    limits = generator.limits
    return replace(resolved, frames=limits.within(max(resolved.frames, round(_least(request.text) * limits.fps))))


def _least(text: TextFeatures) -> float:
    """Return the seconds that the bearings of a text take that are done, one gesture after the other."""
    if not (stated := stated_bearings(text.said)):
        return 0.0  # most prompts: their action need not be read
    done = fitting(stated, action_of(text))
    gestures = [seconds + 2 * BEGINS_S for each in done if (seconds := done_s(each))]
    return max(
        [
            sum(gestures),
            *map(feet_s, done),
            *(WORK_S for each in done if (each.bearing.work and not each.is_done) or each.ends),
        ]
    )
