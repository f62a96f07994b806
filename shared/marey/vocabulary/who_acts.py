"""Texts that name only who acts, told apart from those that say more."""

from __future__ import annotations

import re

from marey.vocabulary.bearing_patterns import doers
from marey.vocabulary.word_lists import load_word_lists

_NO_ACTION = frozenset(
    [
        "a",
        "an",
        "the",
        "is",
        "are",
        "and",
        "who",
        "then",
        "as",
        "while",
        "to",
        "in",
        "at",
        "with",
        "of",
        "want",
        "need",
        "one",
        "where",
        "me",
        "my",
        "make",
        "show",
        "create",
        "generate",
        "animate",
        "animation",
        "clip",
        "please",
        "can",
        "have",
    ]
)
_DOER = re.compile(
    r"^\W*(?:an?|the|my|his|her|this) (?:\w+ )?\w+(?:ist|er|or|ian|[a-z]man|[a-z]woman)s?\W*$"
    r"|^\W*(?:(?:an?|the|my|his|her|our|this) )?(?:[\w-]+ )?"
    r"(?:basketball|tennis|football|soccer|volleyball|baseball|golf|hockey|badminton|rugby|cricket) "
    r"(?:player|star|pro|champion|coach|fan)s?\W*$"
)
"""A noun that names a person by what they do: "a violinist"."""
_GOES_ON = re.compile(
    r"\b(?:go|goes|going|comes?|coming) (?:back )?(?:in|inside|out|outside|through|away|upstairs|downstairs)\b"
)
"""Words of a way of which every one says nothing alone."""
_HANDED = re.compile(r"\b(?:left|right)[- ]handed\b")


def says_more(text: str) -> bool:
    """Return True if a text names more than who acts."""
    if _GOES_ON.search(text.lower()):
        return True
    lists = load_word_lists()
    words = set(re.findall(r"[a-z']+", _HANDED.sub("", text.lower())))
    said = words - lists.people - lists.determiners - lists.skipped - lists.auxiliaries - _NO_ACTION
    if len(said) > 1:
        return not (doers().match(text.lower()) or _DOER.match(text.lower()))
    return bool(said) and not (doers().match(text.lower()) or _DOER.search(text.lower()))
