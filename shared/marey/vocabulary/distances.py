"""How far a prompt has a body go: "walks five metres", "sprints 20 yards", "takes a few steps"."""

from __future__ import annotations

import re

from marey.vocabulary.lengths import NUMBERS

GOING = frozenset({"walk", "walk-backward", "run", "sprint", "sneak", "sidestep", "crawl", "carry"})
"""Actions of a body that goes somewhere."""
METRES = {"m": 1.0, "f": 0.3048, "y": 0.9144, "s": 0.62, "p": 0.7}
"""Metres of a unit, by how it begins: of metres, feet, yards, steps, and paces."""
LEAST, MOST = 0.3, 60.0
"""Metres that are read."""
_NUMBERS = {
    **{word: float(number) for word, number in NUMBERS.items()},
    "thirty": 30.0,
    "forty": 40.0,
    "fifty": 50.0,
    "a": 1.0,
    "an": 1.0,
    "another": 1.0,
    "half a": 0.5,
    "a few": 3.0,
    "another few": 3.0,
    "a couple of": 2.0,
    "a couple": 2.0,
    "several": 4.0,
    "some": 3.0,
    "one and a half": 1.5,
    "two and a half": 2.5,
    "three and a half": 3.5,
}
_WORDS = "|".join(sorted(_NUMBERS, key=len, reverse=True))
_UNIT = r"(?P<unit>met(?:re|er)s?|m|f(?:ee|oo)t|ft|yards?|yds?)"
_DISTANCE = re.compile(
    rf"(?<![\w.,-])(?:(?P<digits>\d{{1,2}}(?:[.,]\d{{1,2}})?)[ -]?|(?P<word>{_WORDS})(?: more| further)?[ -]){_UNIT}"
    r"(?P<half> and a half)?\b(?!['’/²])"
)
_FEW = re.compile(r"\b(?P<word>a few|another few|several|some|a couple more) (?:\w+ )?(?P<unit>steps|paces|strides)\b")
_BEFORE = re.compile(
    r"\b(?:from|within|at|every|than|jump\w*|leap\w*|hop\w*|throw\w*|toss\w*|kick\w*|fall\w*|drop\w*|lift\w*|rais\w+"
    r"|stand\w*|sit\w*|wait\w*|look\w*|see\w*|radius|diameter|circle|climb\w*|high|tall|until)\b[^,.;]*$"
    r"|\b(?:of|the|his|her|its|with|over|to) (?:about |around )?$"
)
_DISTANCE_OF = re.compile(r"\b(?:distance|total|length|way) of (?:about |around |roughly |exactly )?$")
_AFTER = re.compile(
    r"[ -]*(?:wide|high|tall|long|deep|thick|across|radius|diameter|above|below|apart|off the|from the (?:wall|camera)"
    r"|in (?:radius|diameter|height)|circle|behind|in front|a second|per|an hour|up (?:in|into) the air|beneath|under"
    r"|ahead of (?:him|her|them|the|a)\b)"
)
_WIDE = re.compile(r"[ -](?:(?:in )?diameter|across|wide|circles?|rings?|loops?)\b")
_WIDE_BEFORE = re.compile(r"\b(?:diameter|circles?|ring|loop) (?:of |is )?(?:about |around )?$")
_NOUN = re.compile(
    r"-(?!long\b)|[ -](?:pole|sword|stick|rope|ladder|board|wall|fence|platform|log|beam|bar|drop|plank)s?\b"
)
_ONE, _LIMBS_DO = (
    frozenset({"a", "one", "another"}),
    re.compile(r" (?:on|in|together|off|of|planted|flat|wide|first)\b"),
)
_WAY_NOUN = re.compile(r"[ -](?:walk|run|jog|sprint|dash|crawl|sneak|race|march|side-?step|stroll|shuffle)\b")


def stated_distance(prompt: str, action: str) -> float | None:
    """Return the metres that a prompt has a body go; None = it does not say, or says several.

    Args:
        prompt: of one action, as a user typed it.
        action: its id.
    """
    if action not in GOING:
        return None
    text = " ".join(prompt.lower().replace("’", "'").split())
    found = [
        _metres(match)
        for pattern in (_DISTANCE, _FEW)
        for match in pattern.finditer(text)
        if _is_way(text, match.start(), match.end()) and not _is_limb(text, match)
    ]
    return found[0] if len(found) == 1 and LEAST <= found[0] <= MOST else None


def stated_across(prompt: str) -> float | None:
    """Return the metres across a circle that a prompt states, by its radius or its diameter; None = it does not.

    Args:
        prompt: of a way in a circle.
    """
    text = " ".join(prompt.lower().replace("’", "'").split())
    for match in _DISTANCE.finditer(text):
        before, after = text[: match.start()], text[match.end() :]
        if re.match(r"[ -](?:in )?radius\b", after) or re.search(r"\bradius (?:of |is )?(?:about |around )?$", before):
            return 2 * _metres(match)
        if _WIDE.match(after) or _WIDE_BEFORE.search(before):
            return _metres(match)
    return None


def _is_way(text: str, begin: int, end: int) -> bool:
    """Return True if a distance is how far a body goes: not how high, how wide, or from where."""
    before, after = text[:begin], text[end:]
    if _WAY_NOUN.match(after):
        return True
    if _AFTER.match(after) or _NOUN.match(after):
        return False
    return _DISTANCE_OF.search(before) is not None or _BEFORE.search(before) is None


def _is_limb(text: str, match: re.Match[str]) -> bool:
    """Return True if a number of feet are those of the body: "one foot", "both of her two feet on the line"."""
    if match["unit"][0] != "f" or match.groupdict().get("digits"):
        return False
    if text[: match.start()].endswith(" on "):
        return True
    return match["word"] in _ONE or _LIMBS_DO.match(text[match.end() :]) is not None


def _metres(match: re.Match[str]) -> float:
    groups, unit = match.groupdict(), match["unit"]
    digits = groups.get("digits")
    value = float(digits.replace(",", ".")) if digits else _NUMBERS.get(groups["word"] or "", 2.0)
    value += 0.5 if groups.get("half") else 0.0
    return value * (METRES["s"] if unit == "strides" else METRES[unit[0]])
