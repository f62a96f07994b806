"""The lists of `scope_words.toml`: words by which a prompt is read beside the vocabulary's own."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from marey.vocabulary.inflection import noun_forms


@dataclass(frozen=True)
class WordLists:
    """All lists; the file says what each is for. `skipped` may stand inside a phrase, `english` is all of them.

    `denying` are the negations that neither weaken nor end something. `limbs` maps both numbers of a part to the
    singular, `kinds` a noun to the one that stands for it in phrases.
    """

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
    denying: frozenset[str]
    weakening: frozenset[str]
    not_denying: frozenset[tuple[str, ...]]
    nearly: frozenset[str]
    withheld: frozenset[str]
    withheld_from: frozenset[str]
    avoided: frozenset[str]
    ending: frozenset[str]
    counts: frozenset[str]
    uncounted: frozenset[str]
    manner: frozenset[str]
    hypothetical: frozenset[str]
    limbs: Mapping[str, str]
    units: frozenset[str]
    light: frozenset[str]
    averting: frozenset[str]
    loose: frozenset[str]
    of_things: frozenset[str]
    turning: frozenset[str]
    adverbials: tuple[tuple[str, ...], ...]
    kinds: Mapping[str, str]
    other_verbs: tuple[str, ...]
    idioms: tuple[str, ...]
    asides: tuple[str, ...]
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
    sets["denying"] = sets["negations"] - sets["weakening"] - sets["ending"]
    limbs = {form: word for word in sets.pop("limbs") for form in noun_forms(word)}
    del sets["other_verbs"]
    return WordLists(
        **sets,
        limbs=limbs,
        other_verbs=tuple(table["other_verbs"].split()),
        idioms=tuple(table["idioms"]),
        asides=tuple(table["asides"]),
        not_denying=frozenset(tuple(phrase.split()) for phrase in table["not_denying"]),
        adverbials=tuple(tuple(phrase.split()) for phrase in table["adverbials"]),
        kinds={
            form: name for name, words in table["kinds"].items() for word in words.split() for form in noun_forms(word)
        },
        languages=tuple(frozenset(value.split()) for value in table["languages"].values()),
        english=english,
    )
