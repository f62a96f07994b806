"""Fists that punch the air for joy, which are no blows: models read a boxer."""

from __future__ import annotations

import re

_PUNCHES = re.compile(
    r"\bpunch(?P<end>es|ing|ed)?(?: up)?(?: at| into| in)? the (?:air|sky)"
    r"(?: with (?:(?P<both>both (?:of )?(?:his |her |their )?)|(?:his|her|their|a|one) (?P<side>left |right )?)"
    r"(?:fists?|hands?|arms?))?\b(?! (?:in front|ahead|before|repeatedly|again and again|rapidly|like))",
    re.IGNORECASE,
)
_FIGHTS = re.compile(
    r"\b(?:(?:kick)?box\w*|fight\w*|spar\w*|shadow\w*|jabs?|hooks?|uppercuts?|cross(?:es)?|combinations?|combos?|guard"
    r"|stance|martial|karate|kicks?|training|trains?|practi[cs]\w*|left and right|times|throws?)\b",
    re.IGNORECASE,
)
_JOY = re.compile(
    r"\b(?:joy\w*|triumph\w*|victor\w*|celebrat\w*|w[io]ns?|winn\w*|won|goals?|scor\w*|happ\w*|excite\w*|excitement|cheer\w*"
    r"|jump\w*|leap\w*|success\w*|yes|thrill\w*|delight\w*|ecstatic\w*|elat\w*|overjoyed|proud\w*|champion\w*|medal\w*|trophy"
    r"|fans?|footballers?|strikers?|players?|golfers?|runners?|athletes?|both)\b",
    re.IGNORECASE,
)
"""Words of joy, of what there is joy about, and of who has it."""
_ENDS = {"es": "s", "ing": "ing", "ed": "ed"}


def with_pumped_fists(text: str) -> str:
    """Return a text in which a fist that punches the air for joy is pumped; one of a fight stays, and one without
    a word of joy."""
    return text if _FIGHTS.search(text) or not _JOY.search(text) else _PUNCHES.sub(_pumps, text)


def _pumps(found: re.Match[str]) -> str:
    pumps = f"pump{_ENDS.get((found['end'] or '').lower(), '')}"
    return f"{pumps} both fists in the air" if found["both"] else f"{pumps} a {found['side'] or ''}fist in the air"
