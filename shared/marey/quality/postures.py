"""Postures on both sides of a transition between two rows of a timeline: how fast the pelvis rises or sinks.

Rows do not know each other: "walks" after "lies down" begins standing, and the transition has a fraction of a second
for the way up.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, cast

from marey.motion.clip import MotionClip

TIMELINE, TRANSITIONS = "timeline", "transitions"
"""Key of a manifest, and its key with the times of transitions, in seconds."""
RISE, RISE_SPEED = 0.3, 0.8
"""Metres, and metres a second: 1 % of all spans of 0.4 s of captured clips rise or sink by as much."""


def rises_of(clip: MotionClip, transitions: Sequence[Mapping[str, Any]]) -> list[float]:
    """Return how far the pelvis rises from the last frame before each transition to the first one after it, metres; it
    sinks below 0."""
    return [round(float(clip.root[after, 1] - clip.root[before, 1]), 3) for before, after in _edges(clip, transitions)]


def posture_jumps(clip: MotionClip) -> list[Mapping[str, Any]]:
    """Return the transitions of a timeline, with their `rise` in metres, in which the body would have to stand up or go
    down faster than bodies do."""
    record = cast("Mapping[str, Any]", clip.manifest.get(TIMELINE) or {})
    transitions = cast("Sequence[Mapping[str, Any]]", record.get(TRANSITIONS) or ())
    found: list[Mapping[str, Any]] = []
    for each, (before, after), rise in zip(
        transitions, _edges(clip, transitions), rises_of(clip, transitions), strict=True
    ):
        seconds = max(after - before, 1) / clip.fps
        if abs(rise) > RISE and abs(rise) / seconds > RISE_SPEED:
            found.append({**each, "rise": rise})
    return found


def _edges(clip: MotionClip, transitions: Sequence[Mapping[str, Any]]) -> Iterator[tuple[int, int]]:
    last = clip.frames - 1
    for each in transitions:
        yield (
            min(max(round(each["start"] * clip.fps) - 1, 0), last),
            min(max(round(each["end"] * clip.fps), 0), last),
        )
