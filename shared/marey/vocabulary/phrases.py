"""Phrases of the vocabulary in a prompt: the longest ones from left to right, without overlap."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from marey.vocabulary.inflection import noun_forms
from marey.vocabulary.lexicon import EXACT, SELF, WILDCARD, Lexicon, Meaning, PhraseNode
from marey.vocabulary.word_lists import WordLists

STOPS = ".,;:!?"
_TOKEN = re.compile(rf"[^\W\d_]+(?:['’][^\W\d_]+)?|\d+|[{STOPS}]")
_MAX_GAP = 3
"""Words that a wildcard of a phrase stands for, at most."""
_MAX_ADJECTIVES = 2
"""Words of no list between an article and the noun of a phrase: "the rickety wooden chair"."""
_WORD = 4
"""Worth of a word of a phrase where two phrases end at one word."""
_ABOUT = frozenset(["around", "round"])
_ONCE_MORE = frozenset(["other", "whole", "full", "second", "third", "few", "bit", "time", "moment"])
"""Behind "around the": no place that it leads around."""
_CAUSING = frozenset(["make", "let", "have"])
_AWAY = frozenset(["over", "off", "forward", "ahead"])
"""Behind a part of the body whose word is a verb, too: "hand over hand", "laughs his head off"."""


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


@dataclass(frozen=True, slots=True)
class _Open:
    """A phrase that may go on.

    Attributes:
        node: of its words up to here.
        at: the next word.
        end: behind its last own word.
        used: number of its own words, each `_WORD`; more for a form that stands for itself alone, less for a noun that
            another one stands for.
        gap: words that its wildcard stands for.
        adjectives: words that may stand here before its noun; -1 = none are left.
    """

    node: PhraseNode
    at: int
    end: int
    used: int
    gap: int = 0
    adjectives: int = 0


class PhraseFinder:
    """Finds the phrases of a lexicon."""

    def __init__(self, lexicon: Lexicon, lists: WordLists, travels: frozenset[str]) -> None:
        """Keep the tables.

        Args:
            travels: ids of actions whose words say travel: "down" behind their verbs may lead to a place.
        """
        self._lexicon = lexicon
        self._lists = lists
        self._travels = travels
        self._persons = lists.people | lists.plural_people
        self._adverbials: dict[str, list[tuple[str, ...]]] = {}
        for phrase in lists.adverbials:
            self._adverbials.setdefault(phrase[0], []).append(phrase)
        self._kinds = {noun: lexicon.base(kind) for noun, kind in lists.kinds.items()}

    def words(self, prompt: str) -> list[Word]:
        """Split a prompt into words."""
        texts = [text.replace("’", "'") for text in _TOKEN.findall(prompt.lower())]
        return [Word(text, self._base(text.removesuffix("'s"))) for text in texts]

    def _base(self, text: str) -> str:
        """Return the base form of a word, without accents where the lexicon has it so: "jeté"."""
        if text.isascii() or self._lexicon.knows(text):
            return self._lexicon.base(text)
        plain = unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode()
        return self._lexicon.base(plain) if self._lexicon.knows(plain) else text

    def find(self, words: list[Word]) -> list[Match]:
        """Return the phrases that name actions.

        Actions outside the vocabulary count only where they are done, not in "as if she were voting".
        """
        return [match for match in self._matches(words) if not self._hypothetical(words, match)]

    def proper(self, words: list[Word], found: Sequence[Match]) -> list[Match]:
        """Return the phrases without verbs such as "go", which count only where nothing else is named."""
        return [match for match in found if not self._is_manner(words, match)] or list(found)

    def _is_manner(self, words: list[Word], match: Match) -> bool:
        """Return True for a verb that says how, alone or in a phrase that is only read as an action: "swings her
        arms"."""
        if words[match.start].base not in self._lists.manner:
            return False
        return match.end - match.start == 1 or all(meaning.near for meaning in match.meanings)

    def names_person(self, words: list[Word]) -> bool:
        """Return True if a person, or a part of one, is among the words."""
        return any(word.text in self._persons or word.base in self._persons for word in words)

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
        return before in lists.people or not self._lexicon.is_verb_form(before)  # "a guard stands"

    def _matches(self, words: list[Word]) -> list[Match]:
        spans = self._spans(words)
        found = list(self._from_left(words, spans))
        return found or (list(self._from_left(words, {})) if spans else found)

    def _from_left(self, words: list[Word], spans: Mapping[int, int]) -> Iterator[Match]:
        at = 0
        while at < len(words):
            found = None if at in spans or _within(spans, at) else self._longest(words, at, spans)
            if found is None:
                at += 1
            else:
                yield found
                at = found.end

    def _spans(self, words: list[Word]) -> dict[int, int]:
        """Return begin and end of the adverbials ("step by step"), of which no word is an action."""
        spans: dict[int, int] = {}
        for at, word in enumerate(words):
            for phrase in self._adverbials.get(word.text, ()):
                if tuple(each.text for each in words[at : at + len(phrase)]) == phrase:
                    spans[at] = max(spans.get(at, 0), at + len(phrase))
        return spans

    def _longest(self, words: list[Word], start: int, spans: Mapping[int, int]) -> Match | None:
        """Return the phrase from a word on that reaches farthest, of equal ones that with the most words of its own."""
        best: Match | None = None
        most = (0, 0)
        open_nodes: list[_Open] = []
        for key in (words[start].base, EXACT + words[start].text):
            if (root := self._lexicon.root.get(key)) is not None:
                open_nodes.append(_Open(root, start + 1, start + 1, _WORD + key.startswith(EXACT)))
        if words[start].base in _CAUSING and self._is_her_verb(words[start + 1 : start + 3]):
            return None
        while open_nodes:
            state = open_nodes.pop()
            if state.node.meanings and (state.end, state.used) > most and not _within(spans, state.end):
                meanings = self._allowed(words, start, state)
                if meanings:
                    best, most = Match(start, state.end, meanings), (state.end, state.used)
            if state.at < len(words):
                open_nodes += self._next(words, state)
                if state.at in spans:
                    open_nodes.append(replace(state, at=spans[state.at], adjectives=0))
        return best

    def _is_her_verb(self, words: list[Word]) -> bool:
        """Return True for "her turn" in "make her turn around", which makes no turn."""
        return len(words) > 1 and words[0].text == "her" and self._lexicon.is_verb_form(words[1].text)

    def _next(self, words: list[Word], state: _Open) -> Iterator[_Open]:
        """Yield where a phrase may go on."""
        lists, children, word, at = self._lists, state.node.children, words[state.at], state.at + 1
        names = [(word.base, _WORD), (EXACT + word.text, _WORD + 1)]
        if (kind := self._kinds.get(word.text)) is not None:
            names += [(kind, _WORD - 1), (EXACT + kind, _WORD)]
        if state.adjectives in (0, _MAX_ADJECTIVES) or self._is_noun(word):
            for name, worth in names:
                if name in children:
                    yield _Open(children[name], at, at, state.used + worth)
        if self._is_passed_over(word) or word.base == SELF:
            article = word.text in lists.determiners
            yield replace(state, at=at, adjectives=_MAX_ADJECTIVES if article else state.adjectives)
        elif word.text not in lists.breaks:
            if state.adjectives > 0 and self._is_adjective(words, state.at):
                yield replace(state, at=at, adjectives=state.adjectives - 1 or -1)
            if state.gap < _MAX_GAP:
                if state.gap:
                    yield replace(state, at=at, gap=state.gap + 1)
                if (wildcard := children.get(WILDCARD)) is not None:
                    yield _Open(wildcard, at, state.end, state.used, gap=1)

    def _is_passed_over(self, word: Word) -> bool:
        """Return True if a word may stand between those of a phrase: "walks slowly down"."""
        return word.text in self._lists.skipped or word.text.endswith("ly")

    def _is_noun(self, word: Word) -> bool:
        """Return True if a word may be a noun or its adjective."""
        lists = self._lists
        return not (word.text in lists.prepositions or word.text in lists.auxiliaries or word.text in lists.skipped)

    def _is_adjective(self, words: list[Word], at: int) -> bool:
        """Return True if a word that begins no phrase may stand between an article and a noun; "make the man bow"
        makes no bow, "makes a half turn" no turn."""
        word, after = words[at], words[at + 1].base if at + 1 < len(words) else ""
        if not word.text.isalpha() or word.text in self._lists.people or not self._is_noun(word):
            return False
        node = self._lexicon.root.get(word.base)
        if node is None or (word.text != word.base and not word.text.endswith(("ing", "s"))):  # "bent arms"
            return True
        return not node.meanings and after not in node.children

    def _allowed(self, words: list[Word], start: int, state: _Open) -> tuple[Meaning, ...]:
        """Meanings of a phrase at this place: a single verb must stand as one, and a noun in a form of nouns."""
        last = words[state.end - 1]
        if last.text in noun_forms(last.base) or last.text.endswith("ing") or last.base not in noun_forms(last.base):
            meanings = state.node.meanings
        else:
            meanings = tuple(meaning for meaning in state.node.meanings if not meaning.noun)
        single = state.end - start == 1
        if single:
            stands = self.is_verb(words, start)
        elif all(self._is_passed_over(word) for word in words[start + 1 : state.end - 1]):
            of_part = words[start].text in self._lists.limbs and last.text in _AWAY
            stands = not self._leads_to_place(words, start, state.end) and (not of_part or self.is_verb(words, start))
        else:
            stands = True
        return meanings if stands else tuple(meaning for meaning in meanings if meaning.noun)

    def _leads_to_place(self, words: list[Word], start: int, end: int) -> bool:
        """Return True if "up" or "down" behind a verb of travel belongs to a place ("walks down the street", "runs up
        to the fence"), or "around" does ("turns around the corner")."""
        node = self._lexicon.root.get(words[start].base)
        if node is None or not any(each.action in self._travels for each in node.meanings):
            return False
        particle, after = words[end - 1].text, [word.text for word in words[end : end + 2]]
        if not after or after[0] in STOPS:
            return False
        if particle in _ABOUT:
            return (
                after[0] in self._lists.determiners
                and after[0] not in self._lists.counts
                and (len(after) > 1 and after[1] not in _ONCE_MORE)
            )
        if particle not in ("up", "down"):
            return False
        leads = after[0] in ("to", "toward", "towards", "and") or after[0] in self._lists.determiners
        return leads or not (
            after[0] in self._lists.skipped | self._lists.prepositions | self._lists.breaks or after[0].endswith("ly")
        )

    def _hypothetical(self, words: list[Word], match: Match) -> bool:
        if any(meaning.action for meaning in match.meanings):
            return False
        for word in reversed(words[: match.start]):
            if word.text in self._lists.hypothetical:
                return True
            if word.text in STOPS:
                return False
        return False


def _within(spans: Mapping[int, int], at: int) -> bool:
    """Return True if a word is in an adverbial, but not its first one."""
    return any(begin < at < end for begin, end in spans.items())
