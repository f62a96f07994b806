"""Patterns of the words of bearings, expanded from `bearings.toml`."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

from marey.vocabulary.bearings import ONLY, UNLESS, bearing_macros, bearing_table, bearing_words
from marey.vocabulary.inflection import forms_of_other, third_person, verb_forms
from marey.vocabulary.needed_words import Needed, best_of, forms_needed, needed_of_all, needed_words
from marey.vocabulary.word_lists import load_word_lists

_WALK = "walk"
ALL = r"a|an|the|my|his|her|this|that|one|some"
"""Determiners of who acts."""
_VERY = r"(?:(?:very|really|so|rather|quite|extremely|slightly|somewhat|too|visibly|clearly|obviously) )*"
SEEMS = r"(?:look|feel|seem|appear)(?:s|ed|ing)?"
"""Verbs of how a body looks."""
_BE = rf"(?:(?:who|that|which) )?(?:is|are|was|were|being|{SEEMS}(?: to be)?) "
_PRONOUNS = frozenset(["he", "she", "they", "it", "i", "you", "we", "someone", "somebody"])
_GAITS = "walk|run|jog|stroll|march|idle|stance|pose|gait|strut|stride|shuffle|standing|walking|running"
"""Nouns of ways before which an adjective is one of the person: "sad walk"."""
_WAY_VERBS = ("walk", "run", "jog", "stroll", "march", "wander", "stride")
DOES = "does"
"""Group of the words that ask for a bearing, behind the people of whom they do so."""
_GAIT = re.compile(r"([\w|-]+)(.*)", re.DOTALL)


@dataclass(frozen=True)
class WordsOfBearing:
    """The words of a field of a bearing.

    Attributes:
        name: id of the bearing.
        field: of its table.
        entries: as they stand in it.
        needed: one of these stands in each text that has such words; empty = nothing is known of them.
    """

    name: str
    field: str
    entries: Sequence[str]
    needed: Needed

    @cached_property
    def patterns(self) -> Sequence[tuple[str, re.Pattern[str]]]:
        """Kinds and patterns of the words."""
        return [
            (kind, re.compile(rf"(?<![\w'-])(?:{pattern})(?![\w'])"))
            for kind, pattern in _patterns_of(self.field, self.entries)
        ]


def bearing_patterns(text: str) -> Iterator[tuple[str, str, re.Pattern[str]]]:
    """Yield the id of each bearing, and the kind and the pattern of its words, of all that may match in a text."""
    for words in words_of_bearings():
        for needed in words.needed or ("",):
            if needed in text:
                yield from ((words.name, *each) for each in words.patterns)
                break


@lru_cache(maxsize=1)
def words_of_bearings() -> Sequence[WordsOfBearing]:
    """Return the words of all bearings."""
    return [
        WordsOfBearing(name, field, entries, needed_of_all(_needed_by(field, entry) for entry in entries))
        for name, words in bearing_words()
        for field, entries in words.items()
    ]


def _needed_by(field: str, entry: str) -> Needed:
    if field == "by":
        return best_of(map(needed_words, entry.split(" : ", 1)))
    if field in ("gaits", "loads"):
        verbs, tail = _verbs_and_tail(entry)
        return best_of([needed_of_all(map(forms_needed, verbs)), needed_words(tail)])
    return needed_words(entry)


@lru_cache(maxsize=1)
def unless_beside() -> Mapping[str, re.Pattern[str]]:
    """Return the pattern of the words beside which a prompt does not ask for a bearing, by its id."""
    return _words_of_prompts(UNLESS)


@lru_cache(maxsize=1)
def only_beside() -> Mapping[str, re.Pattern[str]]:
    """Return the pattern of the words without which a prompt does not ask for a bearing, by its id."""
    return _words_of_prompts(ONLY)


def _words_of_prompts(field: str) -> Mapping[str, re.Pattern[str]]:
    return {
        name: re.compile(rf"\b(?:{'|'.join(values[field])})\b")
        for name, values in bearing_table().items()
        if field in values
    }


def _patterns_of(kind: str, entries: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Yield kind and pattern; adjectives of a movement are of the kind `how`: "sad walk", "walks home tired"."""
    either = "|".join(entries)
    if kind in ("how", "beside", "meanwhile", "read"):
        yield kind, "|".join(map(_expanded, entries))
    elif kind == "by":
        for who, does in (entry.split(" : ", 1) for entry in entries):
            yield kind, rf"(?:{who})\b[^.;]*?(?<![\w'-])(?P<{DOES}>{_expanded(does)})"
    elif kind in ("gaits", "loads"):
        for verbs, tail in map(_verbs_and_tail, entries):
            forms = frozenset(form for verb in verbs for form in verb_forms(verb))
            yield kind, rf"(?P<verb>{_longest_first(forms)}){_expanded(tail)}"
    elif kind == "adjectives":
        yield kind, rf"{_VERY}(?:{either})(?:,| and|, and)?(?= (?:[\w-]+ ){{0,2}}(?:{_people()})\b)"
        yield kind, rf"{_VERY}(?:{either})(?: and)?(?= [\w-]+ (?:{_goings()})\b)"
        yield kind, rf"{_BE}{_VERY}(?:{either})(?: and)?"
        yield "how", rf"(?:{either})(?= (?:{_GAITS})\b)"
        yield "how", rf"(?<!\ba )(?<!\ban )(?<!\bthe )(?:{either})(?=$|[.,;:!])"
    else:
        yield kind, rf"(?:{either})s?"


def _verbs_and_tail(entry: str) -> tuple[Sequence[str], str]:
    found = _GAIT.match(entry)
    assert found is not None, entry
    return found[1].split("|"), found[2]


def _expanded(pattern: str) -> str:
    """Return a pattern with the forms of its verbs and its macros."""
    for name, words in bearing_macros().items():
        pattern = pattern.replace(name, words)
    return re.sub(r"<(\w+)>", lambda verb: f"(?:{_longest_first(verb_forms(verb[1]))})", pattern)


def _longest_first(words: frozenset[str]) -> str:
    return "|".join(sorted(words, key=len, reverse=True))


@lru_cache(maxsize=1)
def _people() -> str:
    lists = load_word_lists()
    return _longest_first(lists.people - lists.body_parts - _PRONOUNS)


@lru_cache(maxsize=1)
def _goings() -> str:
    """Return the words for "goes" of verbs of ways: what does so is a person, by any name."""
    verbs = {
        verb
        for _, words in bearing_words()
        for verbs, _ in map(_verbs_and_tail, words.get("gaits", ()))
        for verb in verbs
    }
    return _longest_first(frozenset(third_person(verb) for verb in (verbs | {*_WAY_VERBS}) if verb.isalpha()))


@lru_cache(maxsize=1)
def doers() -> re.Pattern[str]:
    """Return the pattern of the people of whom words ask for a bearing that they do not ask for of others."""
    people = (entry.split(" : ", 1)[0] for _, words in bearing_words() for entry in words.get("by", ()))
    return re.compile(rf"\W*(?:(?:{ALL}) )?(?:{'|'.join(people)})\W*$")


@lru_cache(maxsize=1)
def named_by_adjectives() -> re.Pattern[str]:
    """Return the pattern of a text that names a person by an adjective, and says no more: "a drunk sailor"."""
    adjectives = "|".join(each for _, words in bearing_words() for each in words.get("adjectives", ()))
    return re.compile(rf"\W*(?:(?:{ALL}) )?{_VERY}(?:(?:{adjectives}),? (?:and )?)+(?P<noun>[\w-]+)\W*$")


@lru_cache(maxsize=1)
def person_ahead() -> re.Pattern[str]:
    return re.compile(rf" (?:[\w-]+ )?(?:{_people()})\b")


@lru_cache(maxsize=1)
def walking_forms() -> Mapping[str, str]:
    """Return the form of "walk" for each form of a verb that is read so."""
    found: dict[str, str] = {}
    for _, words in bearing_words():
        for verb in (
            verb
            for verbs, _ in map(_verbs_and_tail, [*words.get("gaits", ()), *words.get("loads", ())])
            for verb in verbs
        ):
            found |= forms_of_other(verb, _WALK)
    return found
