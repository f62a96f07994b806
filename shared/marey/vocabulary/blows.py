"""The punches that a prompt lists in their order: "jab, jab, cross", "two left hooks and an uppercut"."""

from __future__ import annotations

import re
from typing import NamedTuple

KINDS = ("hook", "haymaker", "uppercut", "jab", "cross")
"""Kinds of punches."""
NUMBERS = {"a": 1, "an": 1, "one": 1, "two": 2, "double": 2, "couple of": 2, "three": 3, "triple": 3, "four": 4}
_NUMBER = rf"(?P<number>\d|{'|'.join(NUMBERS)})"
_HASTE = r"(?:(?:more|quick|fast|hard|strong|powerful|straight|lead|rear) )*"
_BLOW = re.compile(
    rf"\b(?:{_NUMBER} {_HASTE})?(?:(?P<side>left|right)(?:[ -]hand(?:ed)?)? {_HASTE})?"
    rf"\b(?P<kind>{'|'.join(KINDS)})(?:e?s)?\b(?!-(?:legged|over|step|body))"
    r"(?: (?P<after>left|right)(?: hand)?(?=$|[,.;]| and\b| then\b))?"
    r"(?:,? (?:x ?(?P<by>\d)|(?P<twice>twice)|(?P<times>\w+) times))?"
    r"|\b(?P<bare>left|right)(?: punch(?:es)?)?(?=,|[- ](?:left|right)\b| (?:and|then)\b| combo|$)"
)
_ONE_TWO = re.compile(r"\b(?:one[ -]two|1[ -]2)\b")


class StatedBlow(NamedTuple):
    """A punch that a prompt names.

    Attributes:
        kind: one of `KINDS`; empty = only a side is named.
        side: left or right; empty = none is named.
    """

    kind: str
    side: str


def stated_blows(prompt: str) -> list[StatedBlow]:
    """Return the punches that a prompt lists, each as often as it says; a list of sides alone has three or more."""
    text = _ONE_TWO.sub("jab, cross", " ".join(prompt.lower().split()))
    matches = list(_BLOW.finditer(text))
    kinds = [match for match in matches if match["kind"]]
    found = list[StatedBlow]()
    for match in matches:
        if match["bare"]:
            found.append(StatedBlow("", match["bare"]))
            continue
        often = _value(match["number"]) or 1
        if match is not kinds[-1] or len(matches) == 1:  # behind the last one they are times of the whole list
            often = _value(match["by"] or match["times"]) or (2 if match["twice"] else often)
        found += [StatedBlow(match["kind"], match["side"] or match["after"] or "")] * often
    if kinds and len(found) > 1:
        last = kinds[-1]
        again = _value(last["by"] or last["times"]) or (2 if last["twice"] else 1)
        return found * (again if len(matches) > 1 else 1)
    return found if kinds or len(found) > 2 else []


def _value(word: str | None) -> int | None:
    if not word:
        return None
    return int(word) if word.isdecimal() else NUMBERS.get(word)
