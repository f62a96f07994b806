"""Seconds of gestures, and of work of which a number of strokes is asked for."""

from __future__ import annotations

from marey.generation.gaits import STAMP_S
from marey.vocabulary.bearings import FEET, Bearing, StatedBearing

BEGINS_S, FALL = 0.4, 1.15
"""Seconds before a gesture at least, and how many times as long as it rises it takes to come down."""
PACES = (0.92, 1.08)
"""Bounds of how many times as fast strokes and keys of a gesture are as those of the vocabulary."""
AGAIN_HELD = 0.5
"""Share of the time in which a gesture is held that is made several times."""
TOOL_S = 0.8
"""Seconds in which a tool comes to its place."""
STROKES_RAISED_S = 0.65
"""The same of a hand that makes strokes."""

FEET_S = 3.2
"""Seconds of feet that stamp, tap or shift from one to the other, at least."""


def feet_s(stated: StatedBearing) -> float:
    """Return the seconds of what feet do of who stays where they are, at least; 0 of anything else, and of stamps of a
    number."""
    return FEET_S if stated.bearing.gait in FEET and stated.times is None else 0.0


def raised_s(bearing: Bearing) -> float:
    """Return the seconds in which arms come to their place: more for a tool, and before strokes."""
    return max(bearing.raise_s, TOOL_S if bearing.work else STROKES_RAISED_S if bearing.stroke_hz else 0.0)


def done_s(stated: StatedBearing) -> float:
    """Return the seconds that a gesture, or work of a number of strokes, takes at most, without what is before and
    after it; 0 of what goes on and on. Stamps of a number take theirs."""
    bearing = stated.bearing
    if bearing.gait == "stomp" and stated.times is not None:
        return stated.times * STAMP_S + 2 * BEGINS_S
    if not stated.is_done:
        return 0.0
    rise, hold = raised_s(bearing), stated.hold_s or sum(bearing.hold_s) / 2
    around, through = rise + (bearing.fall_s or FALL * rise), bearing.strokes_s(stated.times or 1)
    if not through and stated.times is not None:
        return stated.times * (around + AGAIN_HELD * bearing.hold_s[1])
    stays = through / PACES[0] if through and (stated.times or bearing.keys) else hold
    return around + stays
