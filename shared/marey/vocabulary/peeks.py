"""Clauses of who leans out to see past something, which is done in the posture in which the body is."""

from __future__ import annotations

import re

from marey.vocabulary.bearing_words import stated_bearings

PEEK = "peek"
"""Bearing of a body that leans out."""
_POSTURES = re.compile(r"\b(?:crouch|kneel|squat|stand|sit|rise|get)\w*\b", re.IGNORECASE)


def only_peeks(text: str) -> bool:
    """Return True if a clause has a body lean out to see past something, and does not say in which posture."""
    return _POSTURES.search(text) is None and any(each.name == PEEK for each in stated_bearings(text))
