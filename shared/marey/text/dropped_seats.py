"""Prompts whose people flop, slump or drop onto a seat or a bed, told as who sits or lies down.

Models read a fall, a death or nothing of "slumps onto the sofa", "plops down" and "collapses onto the bed".
"""

from __future__ import annotations

import re

from marey.vocabulary.inflection import in_form_of

_OF = r"(?:(?:the|a|an|his|her|their|its|some|that|this)\ )?(?:(?!floor|ground)[\w-]+\ ){0,2}?"
_SEATS = (
    r"(?:couch|sofa|settee|loveseat|(?:arm|easy\ |deck|office\ |rocking\ )?chairs?|recliner|bench|seats?|stools?|throne"
    r"|pew|beanbag|ottoman|driver.s\ seat|passenger\ seat|swing|saddle)"
)
_BEDS = r"(?:beds?|mattress|bunk|cot|hammock|futon|pillows?)"
_DROPS = r"""(?P<verb>flop|plop|slump|collaps|drop|sink|sank|plonk|plunk|fall|crash|crumpl|throw|flump|tumbl|settl)
    (?P<end>e?s|e?d|p(?:s|ed|ing)|ing|e)?(?:\ (?:him|her|them|it)sel(?:f|ves))?"""
_HOW = r"(?P<how>(?:\ (?:\w+ly|down|back|backwards?|right|face\ first|exhausted|tired))*)"
_ONTO_SEAT = re.compile(
    rf"\b{_DROPS}{_HOW}\ (?:in|into|on|onto|on\ to|to)\ (?P<where>{_OF}{_SEATS}|{_OF}{_BEDS})\b(?!\ (?:of|to)\b)",
    re.IGNORECASE | re.VERBOSE,
)
_ONTO_IT = re.compile(
    rf"\b{_DROPS}{_HOW}\ (?:in|into|on|onto|on\ to)\ it\b(?P<more>(?:\ (?:\w+ly|exhausted))*)",
    re.IGNORECASE | re.VERBOSE,
)
_DOWN = re.compile(
    r"""\b(?P<verb>flop|plop|plonk|plunk|flump)(?P<end>p?(?:s|ed|ing))?(?:\ (?:him|her|them|it)sel(?:f|ves))?
    (?P<how>(?:\ \w+ly)?)\ down\b(?!\ (?:on|onto|in|into|to|over)\b)""",
    re.IGNORECASE | re.VERBOSE,
)
_WALL = r"(?:wall|door|doorframe|pillar|column|post|pole|tree|trunk|fence|locker|lockers|car|counter|railing|rock)"
_TO_FLOOR = r"(?:\ down|\ to\ the\ (?:floor|ground))"
_BACK_AT = r"(?:(?:with\ )?(?:his|her|their)\ back\ )?"
_DOWN_WALL = re.compile(
    rf"""\b(?:lean(?!\w*\ down)|slump|slid|slide|sink|sank|drop|collaps|crumpl|slip|lower)
    (?P<end>e?s|p?ed|p?ing|e|p?s)?(?:\ (?:him|her|them|it)sel(?:f|ves))?
    (?P<how>(?:\ (?:\w+ly|exhausted|tired|weakly|back|backwards?))*)
    \ (?:down\ {_BACK_AT}(?:(?:against|along|on|to\ the\ (?:floor|ground)\ against)\ )?{_OF}{_WALL}
    |{_BACK_AT}(?:against|along)\ {_OF}{_WALL}
    (?:(?:,\ |,?\ and\ |\ to\ )(?:slid(?:es?|ing)|sink(?:s|ing)?|slips?|slipping)(?:\ \w+ly)?{_TO_FLOOR}+|{_TO_FLOOR}+)
    |to\ the\ (?:floor|ground)\ {_BACK_AT}against\ {_OF}{_WALL})
    (?:\ (?:to|onto)\ the\ (?:floor|ground))?
    (?:(?:\ to|\ until\ (?:he|she)\ is|\ into|\ and)\ (?:a\ )?(?:sits?|sitting|seated|squat)
    (?:\ down)?(?:\ (?:position|on\ the\ (?:floor|ground)))?)?
    (?=$|[.,;!]|\ (?:and|then|exhausted|in|with|while|crying|sobbing|weeping|for)\b)""",
    re.IGNORECASE | re.VERBOSE,
)
"""A body that comes down to a seat on the floor, its back at a wall: "slumps down against the wall"."""
_SEAT, _BED = (re.compile(rf"\b{names}\b", re.IGNORECASE | re.VERBOSE) for names in (_SEATS, _BEDS))
_DEAD = re.compile(r"\b(?:dead|die[sd]?|dying|shot|killed|lifeless(?:ly)?|faint\w*|unconscious)\b", re.IGNORECASE)


def with_seats_taken(prompt: str) -> str:
    """Return a prompt whose people sit down on the seat that they drop onto, or lie down on the bed."""
    if _DEAD.search(prompt):
        return prompt
    prompt = _ONTO_SEAT.sub(_taken, _DOWN_WALL.sub(_at_wall, prompt))
    return _DOWN.sub(_sits, _ONTO_IT.sub(_on_it, prompt))


def _at_wall(found: re.Match[str]) -> str:
    """Return who sits down on the floor; "slumped against the wall" is there already."""
    end = (found["end"] or "").lower()
    if end.endswith("ed"):
        return found[0]
    return f"{_as_verb(found, lies=False)} down on the floor{found['how']}"


def _taken(found: re.Match[str]) -> str:
    """Return who sits down on a seat, or lies down on a bed."""
    if found["verb"].lower() in ("slump", "crumpl", "sink") and (found["end"] or "").lower().endswith("ed"):
        return found[0]  # "slumped in his chair" is there already
    lies = _BED.search(found["where"]) is not None
    return f"{_as_verb(found, lies=lies)} down{_manner(found)} on {found['where']}"


def _on_it(found: re.Match[str]) -> str:
    """Return who sits or lies down on what was named before; of anything but a seat or a bed, the words as they are."""
    before = found.string[: found.start()]
    bed = _BED.search(before) is not None and _SEAT.search(before) is None
    if not bed and not _SEAT.search(before):
        return found[0]
    return f"{_as_verb(found, lies=bed)} down{_manner(found)} on it{found['more']}"


def _sits(found: re.Match[str]) -> str:
    """Return who sits down on the seat that was named before, else on the floor."""
    before = found.string[: found.start()]
    if _BED.search(before) is not None and _SEAT.search(before) is None:
        return f"{_as_verb(found, lies=True)} down{_manner(found)}"
    floor = "" if _SEAT.search(found.string) else " on the floor"
    return f"{_as_verb(found, lies=False)} down{_manner(found)}{floor}"


def _manner(found: re.Match[str]) -> str:
    """Return the manner of a drop: the one that the words name, or a heavy one."""
    named = re.search(r"\b\w+ly\b", found["how"] or "")
    return f" {named[0]}" if named else " heavily"


def _as_verb(found: re.Match[str], *, lies: bool) -> str:
    """Return a verb of sitting or lying in the form of the one that is found."""
    return in_form_of(found["end"] or "", "lie" if lies else "sit")
