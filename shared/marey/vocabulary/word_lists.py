"""The lists of `scope_words.toml`: words by which a prompt is read beside the vocabulary's own."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class WordLists:
    """All lists; the file says what each is for. `skipped` may stand inside a phrase, `english` is all of them."""

    skipped: frozenset[str]
    determiners: frozenset[str]
    prepositions: frozenset[str]
    auxiliaries: frozenset[str]
    sides: frozenset[str]
    breaks: frozenset[str]
    people: frozenset[str]
    body_parts: frozenset[str]
    parts: frozenset[str]
    groups: frozenset[str]
    companions: frozenset[str]
    likened: frozenset[str]
    plural_people: frozenset[str]
    several: frozenset[str]
    not_people: frozenset[str]
    objects: frozenset[str]
    negations: frozenset[str]
    counts: frozenset[str]
    uncounted: frozenset[str]
    manner: frozenset[str]
    hypothetical: frozenset[str]
    other_verbs: tuple[str, ...]
    idioms: tuple[str, ...]
    languages: tuple[frozenset[str], ...]
    english: frozenset[str]


@lru_cache(maxsize=1)
def load_word_lists() -> WordLists:
    """Read the lists that this version ships."""
    table: Mapping[str, Any] = tomllib.loads(Path(__file__).with_name("scope_words.toml").read_text("utf-8"))
    sets = {name: frozenset(value.split()) for name, value in table.items() if isinstance(value, str)}
    english = frozenset(word for words in sets.values() for word in words)
    sets["skipped"] = sets.pop("dropped") | sets.pop("adverbs") | sets["sides"]
    sets["people"] |= sets["body_parts"]
    sets["breaks"] |= frozenset(".,;:!?")
    del sets["other_verbs"]
    return WordLists(
        **sets,
        other_verbs=tuple(table["other_verbs"].split()),
        idioms=tuple(table["idioms"]),
        languages=tuple(frozenset(value.split()) for value in table["languages"].values()),
        english=english,
    )
