"""Forms of drawn movements: which of those that are drawn by chance is the one that a prompt asks for."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache, lru_cache
from pathlib import Path

from marey.drawing.gesture import BOTH, SIDES, Gesture

LONG_S, BRIEF_S = 6.5, 3.0
"""Seconds from which on a movement is longer than one is who asks for no length, alone and beside others."""
MORE_S: Mapping[str, float] = {"bow": 0.5}
"""Seconds more of some actions, which would be a snap otherwise."""
_BOTH = re.compile(r"\b(?:both (?:\w+ )?(?:arms?|hands?)|(?:his|her|their|the|with|two) (?:arms|hands))\b")
_ONE = re.compile(r"\b(?:(?:one|a|an|single) (?:\w+ )?(?:arm|hand)|one[- ](?:armed|handed))\b")
_TEMPOS: Mapping[str, tuple[str, ...]] = {"slow": ("-slow", "-calm"), "fast": ("-quick", "-fast", "-brisk")}
"""Ends of kinds that are at a pace."""
_LONG = re.compile(r"\b(?:long|while|minutes?|seconds?|keeps?|hold\w*|stay\w*|remain\w*|continu\w*|on and on)\b")
_BLOWS = re.compile(
    r"\b(?:punch\w*|jabs?|hooks?|uppercuts?|kicks? (?!the )\w*|\w+ kicks?|block\w*|parr(?:y|ies)|dodg\w*|ducks?"
    r"|weav\w*|guard|box(?:es|er|ers|ing)|fight\w*|spar(?:s|ring)|elbows?|kickbox\w*|karate\w*|strikes?|blows?)\b"
)
"""Words of a fight: between blows, a guard is not let down."""
NAMED, UNASKED, OTHER = 8, 4, 1
"""Weights of a form that is named and missing, of one that is drawn and not named, and of an unusual or long one."""


@dataclass(frozen=True)
class Forms:
    """Forms of one action.

    Attributes:
        named: pattern of the words that ask for a kind, by kind.
        only: kinds that are drawn only if they are named.
        usual: kinds that are drawn where no other is named.
        fights: kinds that are drawn beside other blows.
    """

    named: Mapping[str, re.Pattern[str]] = field(default_factory=dict[str, re.Pattern[str]])
    only: frozenset[str] = frozenset()
    usual: frozenset[str] = frozenset()
    fights: frozenset[str] = frozenset()


@cache
def load_forms() -> Mapping[str, Forms]:
    """Return the forms by action, as `forms.toml` has them; actions without an entry have none."""
    tables = tomllib.loads(Path(__file__).with_name("forms.toml").read_text("utf-8"))
    return {
        action: Forms(
            {kind: re.compile(words.replace("_", r"[\s-]")) for kind, words in table.get("named", {}).items()},
            frozenset(table.get("only", ())),
            frozenset(table.get("usual", ())),
            frozenset(table.get("fights", ())),
        )
        for action, table in tables.items()
    }


@dataclass(frozen=True)
class StatedForm:
    """Everything that a prompt says of the form of a movement.

    Attributes:
        text: of the prompt, in lower case.
        count: repetitions; None = any number.
        side: `left` or `right` of the limb that acts; empty = either.
        brief: it is one of several movements, whose length is open: short, and done once where no number is stated.
        seconds: that it has; None = as many as it takes.
        beside: the movements before and after it, in lower case.
        pace: `slow` or `fast`; empty = either.
    """

    text: str
    count: int | None = None
    side: str = ""
    brief: bool = False
    seconds: float | None = None
    beside: str = ""
    pace: str = ""


def misfit(gesture: Gesture, action: str, asked: StatedForm) -> float:
    """Return how far a movement is from what a prompt says of its form; 0 if it is as said.

    Args:
        gesture: drawn by chance.
        action: id in the vocabulary.
        asked: what the prompt says.
    """
    forms = load_forms().get(action, Forms())
    kinds, text, named = set(gesture.kinds), asked.text, _named(action, asked.text)
    lacks, unasked = len(named - kinds), len((forms.only & kinds) - named)
    unasked += gesture.side in SIDES and bool(_BOTH.search(text))
    unasked += gesture.side == BOTH and bool(_ONE.search(text) or asked.side)
    unasked += gesture.times not in (1, asked.count) and (asked.count is not None or asked.brief)
    unasked += any(is_at_pace(gesture, pace) for pace in _TEMPOS if asked.pace and pace != asked.pace)
    unusual = bool(forms.usual - kinds)
    unusual += bool(forms.fights - kinds) and bool(_BLOWS.search(asked.beside))
    too_long = gesture.seconds > LONG_S and not _LONG.search(text)
    room = BRIEF_S + MORE_S.get(action, 0.0) if asked.brief else asked.seconds
    excess = too_long if room is None else max(gesture.seconds - room, 0.0)
    return NAMED * lacks + UNASKED * unasked + OTHER * (unusual + excess)


def is_at_pace(gesture: Gesture, pace: str) -> bool:
    """Return True if a movement is one of the kinds that are at a pace: `slow` or `fast`."""
    return any(kind.endswith(_TEMPOS.get(pace, ())) for kind in gesture.kinds)


@lru_cache(maxsize=64)  # the same for each of the movements that one prompt chooses from
def _named(action: str, text: str) -> frozenset[str]:
    """Return the kinds of an action that a text names."""
    named = load_forms().get(action, Forms()).named
    return frozenset(kind for kind, words in named.items() if words.search(text))
