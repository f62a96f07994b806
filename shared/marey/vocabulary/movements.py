"""Actions that a prompt describes part by part: "brings the knee up and thrusts the foot forward"."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from typing import Any, cast

from marey.core.errors import InvalidFile
from marey.vocabulary.entries import Vocabulary
from marey.vocabulary.inflection import noun_forms, verb_forms
from marey.vocabulary.lexicon import Meaning
from marey.vocabulary.negation import Span, denies
from marey.vocabulary.phrase_roles import PARTICLES
from marey.vocabulary.phrases import STOPS, Match, Word
from marey.vocabulary.word_lists import WordLists

_FILE = Path(__file__).with_name("movements.toml")
_ANY = "*"
_ENDS = frozenset(["and", "then", "while", "as", "until", "till", "before", "after", "but", "so", "that", *STOPS])
_AND = frozenset(["fro", "forth", "down", "right", "left", "again", "out", "over"])
"""Behind the "and" of an adverbial."""
_MOVING = frozenset(["with", "off"])
"""Prepositions before a part that moves: "pushes off with both feet"."""
_ADJECTIVES = 4
"""Words between a preposition and a part of the body, and the preposition."""
_SLOTS = 3
"""Parts, verbs, where."""


@dataclass(frozen=True)
class _Slot:
    """Words of which one is needed, and words that must not be there; groups of words that follow one another.

    Attributes:
        bases: those of the words that the table has itself, without their other forms.
    """

    words: frozenset[str]
    bases: frozenset[str]
    phrases: tuple[tuple[str, ...], ...]
    without: frozenset[str]
    is_any: bool

    def fits(self, clause: _Clause, *, own: frozenset[str]) -> bool:
        """Return True if a clause with these words of its own, or carried over, has one of the words."""
        if not self.without.isdisjoint(own):
            return False
        return self.is_any or not self.words.isdisjoint(own) or any(map(clause.says, self.phrases))


@dataclass(frozen=True)
class Movement:
    """Movements of the parts of the body in an action, in its order.

    Attributes:
        needs: words of which the prompt has one; empty: none is needed.
        unless: words that are not in the prompt.
    """

    action: str
    steps: tuple[tuple[_Slot, ...], ...]
    needs: _Slot
    unless: _Slot

    def may_be_in(self, prompt: _Clause) -> bool:
        """Return True if a prompt, as one clause, has words of each step, and `needs` and `unless` allow it."""
        own = prompt.own
        for step in self.steps:
            for slot in step:
                if not (slot.is_any or not slot.words.isdisjoint(own) or any(map(prompt.says, slot.phrases))):
                    return False
        needs = self.needs
        if (needs.words or needs.phrases) and not needs.fits(prompt, own=own):
            return False
        return not self.unless.fits(prompt, own=own)


@dataclass(frozen=True)
class _Clause:
    """A clause of a prompt: words [start, end).

    Attributes:
        moved: its words without parts of the body that are places: "to the chest".
        parts: these, with the parts of the clause before if it names none.
    """

    start: int
    end: int
    texts: tuple[str, ...]
    own: frozenset[str]
    moved: frozenset[str]
    parts: frozenset[str]

    def says(self, phrase: tuple[str, ...]) -> bool:
        """Return True if the words follow one another in the clause."""
        length = len(phrase)
        return any(self.texts[at : at + length] == phrase for at in range(len(self.texts) - length + 1))


class Movements:
    """Reads movements of parts of the body as the actions that they make."""

    def __init__(self, lists: WordLists, vocabulary: Vocabulary) -> None:
        """Keep the table; movements of actions that a vocabulary has not are left out."""
        self._lists = lists
        self._vocabulary = vocabulary
        self._table = tuple(movement for movement in load_movements() if movement.action in vocabulary.actions)
        self._verbs = frozenset(word for movement in self._table for step in movement.steps for word in step[1].words)
        self._bases = frozenset(word for movement in self._table for step in movement.steps for word in step[1].bases)
        self._parts = frozenset(
            word for movement in self._table for step in movement.steps for word in step[0].words
        ) | frozenset(lists.limbs)

    def read(self, words: Sequence[Word], found: Sequence[Match], denied: Sequence[Span]) -> list[Match]:
        """Return the phrases of a prompt with the actions that its movements make in place of theirs.

        Verbs such as "pushes" and phrases of parts ("raises the arm") inside a movement belong to it. One with another
        action inside is none, nor is what parts do beside an action ("walks, fists held up").
        """
        if not any(word.text in self._parts for word in words):
            return list(found)
        texts = tuple(word.text for word in words)
        every = frozenset(texts)
        whole = _Clause(0, len(texts), texts, every, every, every)
        possible = [movement for movement in self._table if movement.may_be_in(whole)]
        clauses = list(self._clauses(words, denied)) if possible else []
        taken = set[int]()
        result = list(found)
        for movement in possible:
            places = self._fit(movement, clauses, taken)
            if places is not None:
                result = self._with(movement, words, clauses, places, taken, result) or result
        return result

    def _with(
        self,
        movement: Movement,
        words: Sequence[Word],
        clauses: Sequence[_Clause],
        places: tuple[int, ...],
        taken: set[int],
        found: list[Match],
    ) -> list[Match] | None:
        """Return the phrases with a movement in place of those inside; None if another action is inside or beside."""
        span = clauses[places[0]].start, clauses[places[-1]].end
        inside = [match for match in found if denies([span], match.start)]
        others = [
            match for match in found if not denies([span], match.start) and not self._is_of_parts(words, match, clauses)
        ]
        stated = any(self._is_finite(clauses[place]) for place in places) or not any(map(_names_action, others))
        if not stated or not all(self._is_loose(words, match, movement.action) for match in inside):
            return None
        taken.update(range(places[0], places[-1] + 1))
        if len(places) == 1 and any(self._is_named(match, movement.action) for match in inside):
            return None
        return sorted([*others, Match(*span, (Meaning(movement.action),))], key=lambda match: match.start)

    def _is_named(self, match: Match, action: str) -> bool:
        """Return True for a phrase of this action, or of one that shows it as well."""
        names = {each.action for each in match.meanings if each.action is not None and not each.near}
        return any(action == name or action in self._vocabulary.implied(name) for name in names)

    def _is_of_parts(self, words: Sequence[Word], match: Match, clauses: Sequence[_Clause]) -> bool:
        """Return True for a phrase of parts of the body in a clause that says how: "knees bending"."""
        clause = next((each for each in clauses if each.start <= match.start < each.end), None)
        span = words[match.start : match.end]
        if clause is None or (match.start, match.end) == (clause.start, clause.end):
            return False
        of_parts = any(word.text in self._lists.limbs or word.base in self._lists.units for word in span)
        return of_parts and not self._is_finite(clause)

    # -- clauses ------------------------------------------------------------------------------------------------------

    def _clauses(self, words: Sequence[Word], denied: Sequence[Span]) -> Iterator[_Clause]:
        start, before = 0, frozenset[str]()
        for end in (*(at for at in range(len(words)) if self._divides(words, at)), len(words)):
            texts = tuple(word.text for word in words[start:end])
            if texts and not denies(denied, start):
                own = frozenset(texts)
                moved = own - {words[at].text for at in range(start, end) if self._is_place(words, start, at)}
                carried = moved.isdisjoint(self._parts) or "it" in own
                parts = moved | before if carried else moved
                before = parts & self._parts
                yield _Clause(start, end, texts, own, moved, parts)
            start = end + 1

    def _is_place(self, words: Sequence[Word], start: int, at: int) -> bool:
        """Return True for a part of the body behind a preposition: "to the chest"; "with the foot" moves it."""
        if words[at].text not in self._parts:
            return False
        for before in reversed(words[max(start, at - _ADJECTIVES) : at]):
            if before.text in self._lists.prepositions:
                return before.text not in _MOVING
            if before.base in self._verbs and before.text not in self._lists.skipped:
                return False
        return False

    def _divides(self, words: Sequence[Word], at: int) -> bool:
        """Return True if a word ends a clause; "and" only before another verb, not in "head and chest"."""
        text = words[at].text
        if text != "and":
            return text in _ENDS
        after = [word.text for word in words[at + 1 : at + 4] if word.text not in self._lists.skipped]
        if not after or words[at + 1].text in _AND or (after[0][-3:] == words[at - 1].text[-3:] == "ing"):
            return False  # "to and fro", "rising and falling"
        return after[0] not in self._parts or (len(after) > 1 and after[1] in self._verbs)

    def _is_finite(self, clause: _Clause) -> bool:
        """Return True if a clause has a verb in the third person or an imperative: what the person does."""
        if any(text.endswith("s") and text in self._verbs for text in clause.texts):
            return True
        if any(part.endswith("s") or part == "feet" for part, verb in pairwise(clause.texts) if verb in self._bases):
            return True
        return clause.texts[0] in self._bases

    # -- fitting ------------------------------------------------------------------------------------------------------

    def _fit(self, movement: Movement, clauses: Sequence[_Clause], taken: set[int]) -> tuple[int, ...] | None:
        """Return the clauses of the steps of a movement, in their order."""
        places: list[int] = []
        at = 0
        for step in movement.steps:
            rest = (k for k in range(at, len(clauses)) if k not in taken)
            place = next((k for k in rest if _has(clauses[k], step, first=not places)), None)
            if place is None:
                return None
            places.append(place)
            at = place + 1
        return tuple(places)

    def _is_loose(self, words: Sequence[Word], match: Match, action: str) -> bool:
        """Return True for a phrase that may be a piece of a movement: the same action, one that is only read as an
        action, one of a part of the body, or a verb such as "push"."""
        within = {None, "idle", action, *self._vocabulary.implied(action), self._vocabulary.actions[action].kind_of}
        if all(each.near or each.action in within for each in match.meanings):
            return True
        lists, (verb, *rest) = self._lists, words[match.start : match.end]
        of_part = any(word.text in lists.limbs for word in (verb, *rest))
        particles = all(word.text in lists.skipped or word.text in PARTICLES or word.text == "it" for word in rest)
        return of_part or (verb.base in lists.loose and particles)


def _names_action(match: Match) -> bool:
    """Return True for a phrase that does more than stand, and is not only read as an action."""
    return any(each.action not in (None, "idle") and not each.near for each in match.meanings)


def _has(clause: _Clause, step: tuple[_Slot, ...], *, first: bool) -> bool:
    """Return True if a clause shows a step; the first one of a movement names its part itself."""
    parts, verbs, where = step
    return (
        parts.fits(clause, own=clause.moved if first else clause.parts)
        and verbs.fits(clause, own=clause.own)
        and where.fits(clause, own=clause.own)
    )


@lru_cache(maxsize=1)
def load_movements() -> tuple[Movement, ...]:
    """Read the movements that this version ships.

    Raises:
        InvalidFile: a step has not three slots.
    """
    table: Mapping[str, Any] = tomllib.loads(_FILE.read_text("utf-8"))
    groups = cast("Mapping[str, str]", table["groups"])
    return tuple(
        Movement(
            str(each["action"]),
            tuple(_step(str(step), groups) for step in each["steps"]),
            _slot(str(each.get("with", "")), groups, ()),
            _slot(str(each.get("unless", "")), groups, ()),
        )
        for each in table["movement"]
    )


def _step(text: str, groups: Mapping[str, str]) -> tuple[_Slot, ...]:
    slots = text.split("/")
    if len(slots) != _SLOTS:
        raise InvalidFile(f"step {text!r} is not 'parts / verbs / where'", where=_FILE.name)
    parts, verbs, where = slots
    return _slot(parts, groups, (noun_forms,)), _slot(verbs, groups, (verb_forms,)), _slot(where, groups, (noun_forms,))


def _slot(text: str, groups: Mapping[str, str], forms: Sequence[Any]) -> _Slot:
    names = [name for word in text.split() for name in (groups[word[1:]].split() if word[0] == "$" else [word])]
    plain = [name for name in names if name != _ANY and "_" not in name and name[0] != "!"]
    words = frozenset(form for name in plain for form in (name, *(each for make in forms for each in make(name))))
    return _Slot(
        words,
        frozenset(plain),
        tuple(tuple(name.split("_")) for name in names if "_" in name),
        frozenset(form for name in names if name[0] == "!" for form in noun_forms(name[1:])),
        _ANY in names,
    )
