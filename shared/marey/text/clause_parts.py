"""Clauses whose words name several actions, one after the other (ours).

The reader of sequences was trained on few lists of short commands ("aim, fire") and of many clauses, and leaves some of
them together. Where the words on both sides of a sign that separates them name one action each, they are two.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from marey.text.action_reader import named_actions
from marey.vocabulary.bearing_words import is_done_at_once
from marey.vocabulary.entries import load_vocabulary
from marey.vocabulary.lengths import known_verb_forms

MOST_WORDS = 4
"""Words of a part without a verb at its beginning: "arm circles", "right hook"."""
MOST_PARTS = 8
"""Parts of a clause that are told apart at most."""
ALONE = frozenset({"cartwheel", "flip", "roll", "jump-turn", "push-ups", "sit-ups", "climb-onto", "crawl"})
"""Actions of the whole body, beside which no other is done: behind them, "and" separates as well."""
BLOWS = frozenset({"punch", "kick", "block", "dodge", "slash", "stab", "shoot", "throw"})
"""Deeds of a fight, of which each is over before another one begins: "a boxer jabs and ducks"."""
BESIDE = frozenset({"wave", "clap", "cheer", "laugh", "nod", "talk", "signal", "raise-arm", "shiver", "drink"})
"""Actions that may be done beside others: "walks and waves"."""
JUMPS = frozenset({"jump", "jump-forward", "hop", "leap"})
"""Actions in the air, where a body may turn: "jumps and turns around"."""
SERIES = frozenset({"karate", "dance"})
"""Actions that consist of others: "practises karate, punches and kicks"."""
CHANGES = frozenset({"slow", "speed", "accelerate", "step"})
"""Verbs of who goes on at another pace or place: "slows to a walk", "steps back"."""
IN_TURN = frozenset({"turn", "sidestep", "hop", "dodge"})
"""Actions that are done to one side and then to the other: two of them are no single one."""
BY_WAYS = frozenset({"slash", "block", "kick"})
"""Deeds whose ways through the air tell one from the next: "a slash to the right, then one overhead"."""
_BLADE_WAYS = re.compile(
    r"\b(?:(?P<across>left to right|right to left|horizontal\w*|sideways|side to side)"
    r"|(?P<down>overhead|downwards?|down|vertical\w*|from above)"
    r"|(?P<up>upwards?|uppercut|rising|from below)|(?P<low>low)|(?P<high>high)"
    r"|(?P<diagonal>diagonal\w*))\b",
    re.IGNORECASE,
)
_SIDE = re.compile(r"\b(left|right)(?:wards?)?\b", re.IGNORECASE)
_SIGN = re.compile(
    r"\s*(?:;|\.(?=\s)|->|→|,)\s*(?:and\s+)?(?:then\s+|finally\s+|next\s+)?|\s+(?:and\s+)?then\s+|\s+(?P<and>and)\s+",
    re.IGNORECASE,
)
_CLAUSE = re.compile(r"[;,]|\.\s|->|→|\bthen\b", re.IGNORECASE)
_SUBJECT = re.compile(r"^(?:(?:he|she|they|it)\s+)?(?:\w+ly\s+)*", re.IGNORECASE)
_GOES_ON = re.compile(r"(?:\w+ly\s+)?(?:carr\w+\s+on|goes\s+on|go\s+on|keeps?|continues?)\b", re.IGNORECASE)
"""Beginning of what is the movement before it: "turns left and carries on"."""
_COMMAND = re.compile(r"\W*(?:a|an|one|two|three|four|five|\d+)\b|.*:\s|.*\bthen\b", re.IGNORECASE)
"""Beginning of a list of movements by their names: "two steps left, right hook"."""
_BESIDE = re.compile(r"\w+ing\b|\b(?:with|while|as|both|arms?|hands?|legs?|feet|knees?|head|eyes)\b", re.IGNORECASE)
"""Words of what is done at the same time: "walks, waving", "sits, arms crossed"."""


def parts_in_time(text: str, *, listed: bool = False) -> list[tuple[str, str]]:
    """Return the parts of a clause that come one after the other, each with the id of the action that it names; one
    part, or none, if it is not clear that there are several.

    Args:
        text: of the clause.
        listed: it comes behind others, so that "and" may separate what follows: "walks up, then turns and runs".
    """
    parts = list(_parts(text, listed))
    return parts if len(parts) <= MOST_PARTS and all(action for _, action in parts) else []


def goes_on(text: str) -> bool:
    """Return True if a text begins with words that the movement before it goes on: "and carries on"."""
    return _GOES_ON.match(_SUBJECT.sub("", text)) is not None


def before_next_verb(text: str) -> tuple[str, str]:
    """Return a clause without a verb of its own, and what is behind it: "with a sleeve", "throws it away"."""
    for sign in _SIGN.finditer(text):
        if begins_with_verb(text[sign.end() :]):
            return text[: sign.start()].strip(), text[sign.end() :]
    return text, ""


def only_named(text: str) -> str | None:
    """Return the id of the only action that the words of a text name surely; None if there are several or none."""
    named = load_vocabulary().without_implied(named_actions(text, surely=True))
    return next(iter(named)) if len(named) == 1 else None


def is_on_other_side(before: str, after: str, action: str) -> bool:
    """Return True if an action is done again, on the other side: "turns left, | turns right"."""
    if action in BY_WAYS:
        ways = [_ways_of(text) for text in (before, after)]
        return all(ways) and not ways[0] & ways[1]
    sides = [{side.lower() for side in _SIDE.findall(text)} for text in (before, after)]
    return action in IN_TURN and len(sides[0]) == 1 == len(sides[1]) and sides[0] != sides[1]


def _ways_of(text: str) -> set[str | None]:
    """Return the ways through the air that the words of a blow name."""
    return {found.lastgroup for found in _BLADE_WAYS.finditer(text)}


def _parts(text: str, listed: bool) -> Iterator[tuple[str, str]]:
    begin = 0
    for sign in _SIGN.finditer(text):
        left, right = text[begin : sign.start()], text[sign.end() :]
        if not begins_with_verb(right) and (sign["and"] or not (_is_short_name(right) and _COMMAND.match(left))):
            continue  # before the names are looked for, which takes longer
        if is_done_at_once(f"{left}, {_first(right)}"):
            continue
        action = only_named(left) or ""
        after = only_named(_first(right)) or only_named(_CLAUSE.split(right)[0]) or ""
        if not action or not after:
            continue
        if action == after and (sign["and"] or not is_on_other_side(left, _first(right), action)):
            continue
        if action in SERIES and "then" not in sign[0].lower():
            continue
        evades = after == "dodge" and action in ("throw", "shoot")  # someone else throws
        in_turn = (action in ALONE and len(right.split()) > 1) or ({action, after} <= BLOWS and not evades)
        if sign["and"] and not (listed or in_turn):
            continue
        if sign["and"] and action not in ALONE and (after in BESIDE or action in JUMPS or _GOES_ON.match(right)):
            continue
        yield left.strip(), action
        begin, listed = sign.end(), True
    last = text[begin:].strip()
    yield last, only_named(last) or ""


def _first(text: str) -> str:
    """Return a text up to its next sign."""
    sign = _SIGN.search(text)
    return text if sign is None else text[: sign.start()]


def begins_with_verb(text: str) -> bool:
    """Return True if a text begins with a verb that is no participle: "he quickly turns"."""
    first = re.match(r"[a-z]+", _SUBJECT.sub("", text).lower())
    if first is None or first[0].endswith("ing"):
        return False
    return first[0] in known_verb_forms() or first[0].rstrip("s") in CHANGES


def _is_short_name(text: str) -> bool:
    """Return True if a part is a short name of a movement, and no manner of the one before it."""
    name = _first(text)
    return len(name.split()) <= MOST_WORDS and not _BESIDE.search(name)
