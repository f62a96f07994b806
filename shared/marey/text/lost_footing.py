"""Feet that slip or trip, told as the fall that they end in: "slips on a banana peel", "trips over a log"."""

from __future__ import annotations

import re

_OBJECT = r"(?:(?:a|an|the|some|his|her|their|its|that)\ )?(?:[\w-]+\ ){0,2}?"
_UNDERFOOT = r"""(?:ice|icy\ \w+|black\ ice|banana(?:\ (?:peel|skin))?s?|peels?|floor|puddles?|water|oil|soap|mud|snow
    |grass|stairs?|steps?|ground|marbles?|rug|deck|sidewalk|pavement|leaf|leaves|blood|tiles?|path|street|spill|grease|moss|rocks?
    |stones?|wax|slime|slush|patch|spot|surface|carpet|mat|lego|skateboard|roller\ ?skates?|ball|paint|juice)"""
_OBSTACLE = r"""(?:(?!balance\b|side\b|other\b)[a-z-]+)"""
_SO = (
    r"(?:,?\ and\ then|,?\ and|,?\ then|,)\ (?:(?:he|she|they)\ )?(?:(?:then|suddenly|promptly|almost\ immediately)\ )?"
)
_FLAILING = (
    r"(?:,?\ (?:(?:with\ )?(?:(?:his|her|their)\ )?arms?\ [a-z]+(?:\ \w+ly)?|flailing|wobbling|teetering|swaying))?"
)
_CAUGHT = rf"""(?!\ (?:peels?|skins?)\b)
    (?!{_FLAILING}(?:,?\ (?:and\ then|and|but|then|before|without)|,)(?:\ (?:he|she|they))?
    (?:\ \w+ly|\ just|\ soon|\ manages\ to)*\ (?:catch|regain|recover|keep|find|stead|sav|right|stay|almost|nearly
    |does\ not|doesn't|don't|grab|hold))"""
_FALLS = rf"""(?:{_SO}(?:falls?|falling|fell|lands?|landed|landing|goes\ down|went\ down|crash(?:es|ed|ing)
    |hits?\ the|hitting\ the
    |tumble[sd]|collapse[sd]|drops|dropped)\b
    (?!\ (?:off|from|in(?:to)?\ the\ (?:water|pool|river))\b)
    (?:(?!,|\ (?:and|then|before|but)\b)[^.;,])*)?"""
_SLIPS = re.compile(
    rf"""\b(?P<slip>slip)(?P<end>s|ping|ped)?(?:\ (?:up|over|backwards?|badly|suddenly))?
    (?:\ (?:on|in|over|upon|across)\ {_OBJECT}{_UNDERFOOT}\b(?!\ (?:shoes?|slippers?))
    |(?=\W*$)|(?<=\bslips\ over)|(?=,?\ and\ (?:falls?|lands?)\ (?:flat\ )?(?:on|onto)\b)
    |(?=,?\ and\ falls?(?:\W*$|[,.;]|\ (?:and|then|down|over|backwards?|hard|flat)\b))){_CAUGHT}{_FALLS}""",
    re.IGNORECASE | re.VERBOSE,
)
"""Feet that shoot away from under a body. Who slips left, or into a room, does not fall."""
_LOSES = re.compile(
    rf"""\b(?P<lose>los)(?P<end>es?|ing|t)\ (?:(?:his|her|their|its|the)\ )?(?:footing|foothold)
    (?:\ on\ {_OBJECT}{_UNDERFOOT})?{_CAUGHT}{_FALLS}""",
    re.IGNORECASE | re.VERBOSE,
)
_TRIPS = re.compile(
    rf"""\b(?P<trip>trip)(?P<end>s|ping|ped)?\ (?:over|on)\ (?:(?:a|an|the|some|his|her|their|its)\ )
    (?:(?!and\b|but\b|then\b)[a-z-]+\ ){{0,2}}?
    {_OBSTACLE}(?=\W*$|,|\ (?:and|then|while|before)\b){_CAUGHT}{_FALLS}""",
    re.IGNORECASE | re.VERBOSE,
)
"""Feet that are held by what is before them."""
_DENIED = re.compile(r"\b(?:almost|nearly|without|not|never|avoids?)\ (?:\w+\ )?$", re.IGNORECASE | re.VERBOSE)
_HOW = {"slip": "on the back with slipping feet", "trip": "on the face with tripping feet"}
"""The way in which it falls: a verb of its own would be read as another movement."""
_AS_END = {"": "", "s": "s", "es": "s", "e": "", "ing": "ing", "ping": "ing", "ped": "s", "t": "s"}


def with_falls(prompt: str) -> str:
    """Return a prompt in which a body whose feet slip or trip falls, unless it catches itself or nearly does so."""
    text = _SLIPS.sub(lambda found: _falls(found, "slip"), prompt)
    text = _LOSES.sub(lambda found: _falls(found, "slip"), text)
    return _TRIPS.sub(lambda found: _falls(found, "trip"), text)


def _falls(found: re.Match[str], verb: str) -> str:
    """Return a fall in the form of the verb that is found."""
    if _DENIED.search(found.string[: found.start()]):
        return found[0]
    end = _AS_END[(found["end"] or "").lower()]
    return f"fall{end} {_HOW[verb]}"
