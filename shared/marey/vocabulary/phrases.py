"""Phrases of the vocabulary in a prompt: the longest ones from left to right, without overlap."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

from marey.vocabulary.lexicon import EXACT, WILDCARD, Lexicon, Meaning, PhraseNode
from marey.vocabulary.word_lists import WordLists

STOPS = ".,;:!?"
_TOKEN = re.compile(rf"[^\W\d_]+(?:['’][^\W\d_]+)?|\d+|[{STOPS}]")
_MAX_GAP = 3
"""Words that a wildcard of a phrase stands for, at most."""


@dataclass(frozen=True, slots=True)
class Word:
    """A word of a prompt, lower case, with its base form; stops are words, too."""

    text: str
    base: str


@dataclass(frozen=True, slots=True)
class Match:
    """A phrase found at words [start, end)."""

    start: int
    end: int
    meanings: tuple[Meaning, ...]


class PhraseFinder:
    """Finds the phrases of a lexicon."""

    def __init__(self, lexicon: Lexicon, lists: WordLists) -> None:
        """Keep the tables."""
        self._lexicon = lexicon
        self._lists = lists

    def words(self, prompt: str) -> list[Word]:
        """Split a prompt into words."""
        texts = [text.replace("’", "'") for text in _TOKEN.findall(prompt.lower())]
        return [Word(text, self._lexicon.base(text.removesuffix("'s"))) for text in texts]

    def find(self, words: list[Word]) -> list[Match]:
        """Return the phrases that name actions.

        Verbs such as "go" count only where nothing else is named, and actions outside the vocabulary only where they
        are done, not in "as if she were voting".
        """
        found = list(self._matches(words))
        manner = self._lists.manner
        proper = [match for match in found if match.end - match.start > 1 or words[match.start].base not in manner]
        return [match for match in proper or found if not self._hypothetical(words, match)]

    def names_person(self, words: list[Word]) -> bool:
        """Return True if a person, or a part of one, is among the words."""
        people = self._lists.people | self._lists.plural_people
        return any(word.text in people or word.base in people for word in words)

    def may_be_things(self, words: list[Word], found: list[Match]) -> bool:
        """Return True if every phrase is a single noun ("a bow", "run of stairs"), and no person is named."""
        return not self.names_person(words) and all(self._may_be_thing(words, match) for match in found)

    def _may_be_thing(self, words: list[Word], match: Match) -> bool:
        if match.end - match.start > 1 or not any(meaning.noun for meaning in match.meanings):
            return False
        before_of = match.end < len(words) and words[match.end].text == "of"
        return not self.is_verb(words, match.start) or (match.start == 0 and before_of)

    def is_verb(self, words: list[Word], at: int) -> bool:
        """Return True if a word may be a verb here: not behind an article, a preposition or another verb."""
        text = words[at].text
        if at == 0 or text.endswith(("ing", "ed")):
            return True
        lists = self._lists
        before = words[at - 1].text
        if before in lists.auxiliaries or before in lists.breaks:
            return True
        if before in lists.sides and at > 1:  # "to the left", "his left"
            before = words[at - 2].text
        if before in lists.determiners or before in lists.prepositions:
            return False
        if text == words[at].base:  # "make the man bow", "they slowly bow"
            return before in lists.people or before in lists.plural_people or before.endswith("ly")
        return not self._lexicon.is_verb_form(before)

    def _matches(self, words: list[Word]) -> Iterator[Match]:
        at = 0
        while at < len(words):
            found = self._longest(words, at)
            if found is None:
                at += 1
            else:
                yield found
                at = found.end

    def _longest(self, words: list[Word], start: int) -> Match | None:
        root = self._lexicon.root.get(words[start].base)
        if root is None:
            return None
        best: Match | None = None
        open_nodes: list[tuple[PhraseNode, int, int, int]] = [(root, start + 1, start + 1, 0)]
        while open_nodes:
            node, at, end, gap = open_nodes.pop()
            longer = best is None or end > best.end
            if node.meanings and longer and (meanings := self._allowed(words, start, end, node)):
                best = Match(start, end, meanings)
            if at < len(words):
                open_nodes += self._next(words[at], node, at, end, gap)
        return best

    def _next(
        self, word: Word, node: PhraseNode, at: int, end: int, gap: int
    ) -> Iterator[tuple[PhraseNode, int, int, int]]:
        """Yield where a phrase may go on behind a word: node, next word, end of the phrase, words of the wildcard."""
        child = node.children.get(word.base) or node.children.get(EXACT + word.text)
        if child is not None:
            yield child, at + 1, at + 1, 0
        if word.text in self._lists.skipped or word.text.endswith("ly"):
            yield node, at + 1, end, gap
        elif gap < _MAX_GAP and word.text not in self._lists.breaks:
            if gap:
                yield node, at + 1, end, gap + 1
            if (wildcard := node.children.get(WILDCARD)) is not None:
                yield wildcard, at + 1, end, 1

    def _allowed(self, words: list[Word], start: int, end: int, node: PhraseNode) -> tuple[Meaning, ...]:
        """Meanings of a phrase at this place: a single verb must stand as one."""
        if end - start > 1 or self.is_verb(words, start):
            return node.meanings
        return tuple(meaning for meaning in node.meanings if meaning.noun)

    def _hypothetical(self, words: list[Word], match: Match) -> bool:
        if any(meaning.action for meaning in match.meanings):
            return False
        for word in reversed(words[: match.start]):
            if word.text in self._lists.hypothetical:
                return True
            if word.text in STOPS:
                return False
        return False
