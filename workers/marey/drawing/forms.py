"""Forms of drawn movements: which of those that are drawn by chance is the one that a prompt asks for."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

from marey.drawing.gesture import BOTH, SIDES, Gesture

LONG_S = 6.5
"""Seconds from which on a movement is longer than one is who asks for no length."""
_BOTH = re.compile(r"\b(?:both (?:\w+ )?(?:arms?|hands?)|(?:his|her|their|the|with|two) (?:arms|hands))\b")
_ONE = re.compile(r"\b(?:(?:one|a|an|single) (?:\w+ )?(?:arm|hand)|one[- ](?:armed|handed))\b")
_LONG = re.compile(r"\b(?:long|while|minutes?|seconds?|keeps?|hold\w*|stay\w*|remain\w*|continu\w*|on and on)\b")
NAMED, UNASKED, OTHER = 8, 4, 1
"""Weights of a form that is named and missing, of one that is drawn and not named, and of an unusual or long one."""


@dataclass(frozen=True)
class Forms:
    """Forms of one action.

    Attributes:
        named: pattern of the words that ask for a kind, by kind.
        only: kinds that are drawn only if they are named.
        usual: kinds that are drawn where no other is named.
    """

    named: Mapping[str, re.Pattern[str]] = field(default_factory=dict[str, re.Pattern[str]])
    only: frozenset[str] = frozenset()
    usual: frozenset[str] = frozenset()


@cache
def load_forms() -> Mapping[str, Forms]:
    """Return the forms by action, as `forms.toml` has them; actions without an entry have none."""
    tables = tomllib.loads(Path(__file__).with_name("forms.toml").read_text("utf-8"))
    return {
        action: Forms(
            {kind: re.compile(words.replace("_", r"[\s-]")) for kind, words in table.get("named", {}).items()},
            frozenset(table.get("only", ())),
            frozenset(table.get("usual", ())),
        )
        for action, table in tables.items()
    }


def misfit(gesture: Gesture, action: str, text: str, count: int | None = None) -> int:
    """Return how far a movement is from what a prompt says of its form; 0 if it is as said.

    Args:
        gesture: drawn by chance.
        action: id in the vocabulary.
        text: of the prompt, in lower case.
        count: repetitions that are asked for; None = any number.
    """
    forms = load_forms().get(action, Forms())
    kinds = set(gesture.kinds)
    named = {kind for kind, words in forms.named.items() if words.search(text)}
    lacks = len(named - kinds)
    unasked = len((forms.only & kinds) - named)
    if gesture.side in SIDES and _BOTH.search(text):
        unasked += 1
    if gesture.side == BOTH and _ONE.search(text):
        unasked += 1
    if count is not None and gesture.times not in (1, count):
        unasked += 1
    unusual = bool(forms.usual - kinds)
    too_long = gesture.seconds > LONG_S and not _LONG.search(text)
    return NAMED * lacks + UNASKED * unasked + OTHER * (unusual + too_long)
