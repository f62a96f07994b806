"""Words that have a body lift or put down a load for two hands."""

from __future__ import annotations

import re

_THING = (
    r"(?:(?:heavy|big|large|wooden|metal|cardboard|full|huge|small|light|empty|old|\w+) ){0,2}?(?:box|boxes|crates?|"
    r"packages?|parcels?|chests?|barrels?|kegs?|cartons?|boulders?|logs?|trunk|suitcases?|baskets?|buckets?|cases?|"
    r"laundry|sacks?|tires?|tyres?|loads?|weights?|(?:stack|pile|armful) of \w+|tv|monitor|sofa|table|chair|stool)\b"
)
_THE = r"(?:(?:a|an|the|his|her|their|some|two|that|this) )?"
_LIFTS = re.compile(
    r"\b(?:lifts?|lifting|picks?(?: up)?|picking(?: up)?|grabs?|grabbing|hoists?|hoisting|heaves?|takes?)(?: up)? "
    rf"{_THE}{_THING}"
)
_PUTS_IT = re.compile(
    r"\b(?P<verb>puts?|putting|sets?|setting|lays?|laying|lowers?|lowering|places?|placing|drops?|dropping|deposits?)"
    rf"(?: (?:down|back))* (?:it|them|{_THE}{_THING})(?: (?:back|gently|carefully))*"
    r"(?:(?= (?:down|on|onto|to the (?:floor|ground)|in|into|there|aside|beside|next|by|at)\b)"
    r"|(?=\W*$)|(?=,| and\b| then\b))"
)
_PUTS_DOWN = re.compile(
    rf"\b(?:puts?|putting|sets?|setting|lays?|laying) down (?:it|them|{_THE}{_THING})"
    rf"|\bdrops? (?:it|them|{_THE}{_THING})"
)
_PRONOUN = re.compile(r"\b(?:it|them)\b")
_BEFORE = re.compile(
    r"\b(?:carr(?:y|ies|ying)|walk\w*|turn\w*|step\w*|go(?:es)?|lugs?|hauls?|moves?|stagger\w*|run\w*|jog\w*"
    r"|takes?|brings?)\b"
)
"""Movements before it in which a load may be held."""


def lifts_load(said: str) -> bool:
    """Return True if words have a body lift something that takes two hands."""
    return bool(_LIFTS.search(said.lower())) and not _PUTS_IT.search(said.lower())


def puts_load(said: str, before: str = "") -> bool:
    """Return True if words have a body put down something that takes two hands; `before`: the movement before it, which
    tells if "it" is carried."""
    text = said.lower()
    found = _PUTS_IT.search(text) or _PUTS_DOWN.search(text)
    if found is None or _LIFTS.search(text):
        return False
    return not _PRONOUN.search(found[0]) or bool(_LIFTS.search(before.lower()) or _BEFORE.search(before.lower()))
