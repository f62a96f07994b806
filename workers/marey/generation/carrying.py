"""Loads for two hands that a prompt has a body lift or put down."""

from __future__ import annotations

import random
import re

from marey.drawing.gesture import Gesture
from marey.drawing.loads import lift, put_down
from marey.generation.fine_wish import FineWish

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
_TABLES = re.compile(
    r"\b(?:tables?|desks?|counters?|workbench|bench|truck|trunk|cart|trolley|conveyor|car|van|chair|bed|sofa|platform)\b"
)
_SHELVES = re.compile(r"\b(?:shelf|shelves|rack|cupboard|cabinet)\b")
WALKS = "walks"
"""A movement in which a load may be held."""
_HEAVY = re.compile(r"\b(?:heav\w+|huge|struggl\w+|big|large|slowly|boulders?|barrels?)\b")
_DROPS = re.compile(r"\bdrop(?:s|ping)?\b")


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


def stated_load(wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture | None:
    """Return the lift or the put-down of a load for two hands; None if the prompt asks for neither."""
    del seconds
    text, before = wish.prompt.lower(), wish.beside[0].lower()
    if puts_load(text, before):
        where = text if _TABLES.search(text) or _SHELVES.search(text) else f"{text} {before}"
        onto = "shelf" if _SHELVES.search(where) else "table" if _TABLES.search(where) else "floor"
        on_floor = re.search(r"\b(?:floor|ground)\b", text)
        return put_down(rng, "floor" if on_floor else onto, drops=bool(_DROPS.search(text)))
    return lift(rng, heavy=bool(_HEAVY.search(text))) if lifts_load(text) else None
