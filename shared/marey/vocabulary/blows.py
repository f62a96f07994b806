"""The punches that a prompt lists in their order: "jab, jab, cross", "two left hooks and an uppercut"."""

from __future__ import annotations

import re
from typing import NamedTuple

KINDS = {
    "hook": r"hook",
    "haymaker": r"haymaker",
    "uppercut": r"uppercut",
    "jab": r"jab",
    "cross": r"cross",
    "overhand": r"over[- ]?hand",
    "backfist": r"back[- ]?fist|back[- ]?hand(?:ed)? (?:punch|strike|blow)",
    "hammer fist": r"hammer[- ]?fist",
    "palm strike": r"palm(?:[- ]heel)?[- ](?:strike|blow)",
    "straight": r"straight",
}
"""Patterns of the kinds of punches, in the singular."""
_SIDED = r"(?= (?:left|right)(?: hand)?(?:$|[,.;]| (?:and|then|to|at)\b))"
_ONLY_BEFORE = {"overhand": r"(?= (?:left|right|punch|blow)|[,.;]|$)", "straight": _SIDED}
"""Words behind one that is no punch elsewhere: "throws overhand", "walks straight"."""
_NUMBERS = {"a": 1, "an": 1, "one": 1, "two": 2, "double": 2, "couple of": 2, "three": 3, "triple": 3, "four": 4}
"""Words of numbers of punches."""
_NUMBER = rf"(?P<number>\d|{'|'.join(_NUMBERS)})"
_HEAVY = r"heavy|hard|strong|powerful|big|huge|mighty|massive|brutal|devastating|crushing|wide"
_LIGHT = r"light|quick|rapid|fast|sharp|snappy|short|tight|soft"
_HASTE = rf"(?:(?:{_HEAVY}|{_LIGHT}|more|slow|clean|solid|final|single|straight|lead|rear|long|boxing|body),? )*"
"""Words between a number, a side and the kind of a punch."""
_KIND = rf"(?:{'|'.join(pattern + _ONLY_BEFORE.get(kind, '') for kind, pattern in KINDS.items())})"
_HAND = r"(?:(?:with|using|off) (?:(?:his|her|their|the|a) )?)"
_BLOW = re.compile(
    rf"\b(?:{_NUMBER} {_HASTE})?(?:(?P<side>left|right)(?:[ -]hand(?:ed)?)? {_HASTE})?(?:{_HASTE})"
    rf"\b(?P<kind>{_KIND})(?:e?s)?\b(?!-(?:legged|over|step|body))"
    rf"(?: {_HAND}?(?P<after>left|right)(?: (?:hand|fist|arm))?(?=$|[,.;]| (?:and|then|to|at)\b))?"
    r"(?:,? (?:x ?(?P<by>\d)|(?P<twice>twice)|(?P<times>\w+) times))?"
    r"|\b(?<!with )(?<!with the )(?<!with his )(?<!with her )(?<!to the )"
    r"(?P<bare>left|right)(?: punch(?:es)?)?(?=,|[- ](?:left|right)\b| (?:and|then)\b| combo|$)"
)
_ONE_TWO = re.compile(r"\b(?:one[ -]two|1[ -]2)\b")
_LABEL = re.compile(rf"^({_HASTE}{_KIND}),? (left|right)(?: hand)?(?=$|,|-| {_HASTE}$)")
"""A single punch as libraries of motions name it: "uppercut, right, heavy"."""
_WEIGHTS = {"heavy": re.compile(rf"\b(?:{_HEAVY}|heavily)\b"), "light": re.compile(rf"\b(?:{_LIGHT}|lightly)\b")}


class StatedBlow(NamedTuple):
    """A punch that a prompt names.

    Attributes:
        kind: a key of `KINDS`; empty = only a side is named.
        side: left or right; empty = none is named.
        weight: heavy or light; empty = neither is said.
    """

    kind: str
    side: str
    weight: str = ""


def stated_blows(prompt: str) -> list[StatedBlow]:
    """Return the punches that a prompt lists, each as often as it says; a list of sides alone has three or more."""
    text = _ONE_TWO.sub("jab, cross", " ".join(prompt.lower().split()))
    if len(re.findall(rf"\b{_KIND}", text)) == 1:
        text = _LABEL.sub(r"\2 \1", text)
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
        weight = _weight(text if len(matches) == 1 else match[0])
        found += [StatedBlow(_kind(match["kind"]), match["side"] or match["after"] or "", weight)] * often
    if kinds and len(found) > 1:
        last = kinds[-1]
        again = _value(last["by"] or last["times"]) or (2 if last["twice"] else 1)
        return found * (again if len(matches) > 1 else 1)
    return found if kinds or len(found) > 2 else []


def _kind(word: str) -> str:
    """Return the kind of punches that a word of one names."""
    return next(kind for kind, pattern in KINDS.items() if re.match(pattern, word))


def _weight(words: str) -> str:
    """Return the weight that words name; empty if none, or both."""
    named = [name for name, pattern in _WEIGHTS.items() if pattern.search(words)]
    return named[0] if len(named) == 1 else ""


def _value(word: str | None) -> int | None:
    if not word:
        return None
    return int(word) if word.isdecimal() else _NUMBERS.get(word)
