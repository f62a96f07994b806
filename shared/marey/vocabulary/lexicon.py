"""Tables of words: base forms, and the phrases that name actions as a tree of words."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

from marey.vocabulary.entries import Vocabulary
from marey.vocabulary.inflection import noun_forms, verb_forms

WILDCARD = "~"
"""Stands in a phrase for one to three words: "pick ~ up"."""
EXACT = "="
"""Before a word of a phrase that stands for this form alone: "be =punched"."""
_LEFT_OUT = frozenset({"a", "an", "the", "his", "her", "one", "two", "both", "own"})
SELF = "self"
"""Stands in a phrase for any reflexive pronoun: "pick self up"."""
REFLEXIVES = frozenset(f"{who}self" for who in ("my", "your", "him", "her", "it", "one", "them")) | {
    "ourselves",
    "yourselves",
    "themselves",
}


@dataclass(frozen=True)
class Meaning:
    """Meaning of a phrase.

    Attributes:
        action: id; None = an action outside the vocabulary.
        near: the phrase is only read as this action.
        noun: the phrase is a noun, and names the action wherever it stands.
        aside: the phrase is no action beside others: "throws in some jumps".
    """

    action: str | None
    near: bool = False
    noun: bool = False
    aside: bool = False


@dataclass(slots=True)
class PhraseNode:
    """A node of the phrase tree: meanings of the words up to here, and the words that may follow."""

    meanings: tuple[Meaning, ...] = ()
    children: dict[str, PhraseNode] = field(default_factory=dict[str, "PhraseNode"])


class Lexicon:
    """The words of a vocabulary, with verbs and idioms that are outside it."""

    def __init__(
        self, vocabulary: Vocabulary, other_verbs: Iterable[str], idioms: Iterable[str], asides: Iterable[str] = ()
    ) -> None:
        """Build the tree of all phrases."""
        self.root: dict[str, PhraseNode] = {}
        self._base: dict[str, str] = dict.fromkeys(REFLEXIVES, SELF)
        self._verbs = set[str]()
        entries = [(words_of(phrase), meaning) for phrase, meaning in _phrases(vocabulary)]
        outside = [(words_of(phrase), Meaning(None)) for phrase in (*other_verbs, *idioms)]
        outside += [(words_of(phrase), Meaning(None, aside=True)) for phrase in asides]
        for words, meaning in (*entries, *outside):
            self._add_forms(words, noun=meaning.noun)
        for words, meaning in entries:
            if meaning.noun and len(words) == 1 and words[0].endswith("ing"):  # "boxing": no name for a box
                meaning = replace(meaning, noun=False)
            self._add([self.base(word) for word in words], meaning)
        for words, meaning in outside:
            known = [self.base(word) for word in words]
            if not self._has(known):
                self._add(known, meaning)

    def base(self, word: str) -> str:
        """Return the base form of a word; the word itself if it is in no phrase."""
        return self._base.get(word, word)

    def knows(self, word: str) -> bool:
        """Return True if the word is in a phrase, in any form."""
        return word in self._base

    def is_verb_form(self, word: str) -> bool:
        """Return True if the word is a form of a verb that begins a phrase."""
        return word in self._verbs

    def _add_forms(self, words: list[str], *, noun: bool) -> None:
        for at, word in enumerate(words):
            if word.startswith((WILDCARD, EXACT)):
                continue
            verb = not at and not noun
            self._base.setdefault(word, word)
            for form in verb_forms(word) | noun_forms(word) if verb else noun_forms(word):
                if self._base.get(form, form) == form and len(word) <= len(form):  # "arms" is a word of its own, too
                    self._base[form] = word
            if verb:
                self._verbs |= verb_forms(word)

    def _add(self, words: list[str], meaning: Meaning) -> None:
        node = self.root.setdefault(words[0], PhraseNode())
        for word in words[1:]:
            node = node.children.setdefault(word, PhraseNode())
        if meaning not in node.meanings:
            node.meanings = (*node.meanings, meaning)

    def _has(self, words: list[str]) -> bool:
        node = self.root.get(words[0])
        for word in words[1:]:
            node = node.children.get(word) if node else None
        return node is not None and bool(node.meanings)


def _phrases(vocabulary: Vocabulary) -> Iterable[tuple[str, Meaning]]:
    for action in vocabulary.actions.values():
        yield from ((phrase, Meaning(action.id)) for phrase in action.verbs)
        yield from ((phrase, Meaning(action.id, noun=True)) for phrase in action.nouns)
        yield from ((phrase, Meaning(action.id, near=True)) for phrase in action.near)


def words_of(phrase: str) -> list[str]:
    """Return the words of a phrase, without articles and possessives."""
    words = phrase.replace("-", " ").split()
    return [word for word in words if word not in _LEFT_OUT] or words
