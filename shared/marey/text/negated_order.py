"""Negations that tell an order of movements, and leave none out (ours): "runs off, but not before waving" and "won't
sit down until he has bowed" ask for both movements."""

from __future__ import annotations

import re

from marey.vocabulary.inflection import phrase_in_third_person

_NOT_BEFORE = re.compile(
    r"\b(?:(?:but|though) )?not (?:before|until|till)(?= (?:\w+ing|he|she|they|it|an? \w+ \w+s|the \w+ \w+s)\b)",
    re.IGNORECASE,
)
_TIRED = re.compile(
    r"\b(?P<until>until|till) (?P<who>(?:(?:the|his|her|their) )?\w+) (?:can(?:'t|not)|can no longer)(?! see| hear)\b"
    r"[^,;.]*",
    re.IGNORECASE,
)
_UNTIL = re.compile(
    r"\b(?:won't|will not|doesn't|does not|refuses to) (?P<does>[a-z]+)(?P<how>\b[^,;.]*?),? (?:until|till|before)"
    r" (?P<first>\w)",
    re.IGNORECASE,
)
_STOPS = re.compile(r"(?:stop|cease|quit)s?\Z", re.IGNORECASE)


def without_negated_order(prompt: str) -> str:
    """Return a prompt with negations that tell an order said without them: "sits down only after he has bowed" of
    "won't sit down until he has bowed". Any other prompt is returned as it is."""
    tired = _TIRED.sub(r"\g<until> \g<who> is tired", prompt)
    return _NOT_BEFORE.sub(_only_after, _UNTIL.sub(_after, tired))


def _after(found: re.Match[str]) -> str:
    if _STOPS.match(found["does"]):
        return found[0]
    return f"{phrase_in_third_person(found['does'])}{found['how']} only after {found['first']}"


def _only_after(found: re.Match[str]) -> str:
    return "but only after" if found.start() else "Only after"
