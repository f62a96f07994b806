"""Flags of a prompt: what its words say that no motion of one person shows."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Literal

from marey.vocabulary.lexicon import Lexicon
from marey.vocabulary.phrases import Match, Word
from marey.vocabulary.word_lists import WordLists

Flag = Literal[
    "negation",
    "objects",
    "counts",
    "length",
    "several-people",
    "other-subject",
    "other-language",
    "no-action",
    "gibberish",
]
"""`objects`: mimed, the motion shows the body alone; `length`: a stated one is that of a part, or out of the bundle's
range; `counts`: may be done another number of times."""

_FOREIGN_SHARE = 0.3
"""Share of the words that are another language's and not English, from which on the prompt is; twice that with any."""
_GIBBERISH_SHARE = 0.5
_LEAST_WORDS = 4
"""Words of a prompt with an action that may be gibberish nevertheless ("lorem ipsum dolor sit amet")."""
_MAX_SUBJECT = 5
"""Words within which the subject stands."""


class Flagger:
    """Reads flags from the words of a prompt."""

    def __init__(self, lexicon: Lexicon, lists: WordLists) -> None:
        """Keep the tables."""
        self._lexicon = lexicon
        self._lists = lists

    def details(self, words: list[Word], found: list[Match]) -> Iterator[Flag]:
        """Yield the flags of a prompt whatever it names."""
        lists = self._lists
        texts = [word.text for word in words]
        if any(text in lists.negations for text in texts):
            yield "negation"
        verbs = {match.start for match in found if match.end - match.start == 1}
        if any(word.base in lists.objects and at not in verbs for at, word in enumerate(words)):
            yield "objects"
        if any(self._counts(words, at) for at in range(len(words))):
            yield "counts"
        if self._several(texts):
            yield "several-people"

    def foreign(self, words: list[Word], found: list[Match]) -> Flag | None:
        """Return the flag of a prompt that names no person's action in English."""
        texts = [word.text for word in words if word.text.isalpha()]
        if self._is_other_language(texts):
            return "other-language"
        if words and self._is_other_subject(words):
            return "other-subject"
        return "gibberish" if self._is_gibberish(texts, bool(found)) else None

    def _counts(self, words: list[Word], at: int) -> bool:
        text = words[at].text
        if text not in self._lists.counts and not (text.isdecimal() and len(text) < 3):
            return False
        after = words[at + 1] if at + 1 < len(words) else Word("", "")
        return after.base not in self._lists.uncounted and after.text.removesuffix("s") not in self._lists.uncounted

    def _several(self, texts: list[str]) -> bool:
        pairs = set(pairwise(texts))
        if ("each", "other") in pairs or ("one", "another") in pairs or {"together", "people"} <= set(texts):
            return True
        return any(a in self._lists.several and b in self._lists.plural_people for a, b in pairs)

    def _is_other_subject(self, words: list[Word]) -> bool:
        """Return True if the first noun is an animal or a thing that does something."""
        lists = self._lists
        bare = words[0].text not in lists.determiners
        for at, word in enumerate(words[:_MAX_SUBJECT]):
            if word.text in lists.people or word.base in lists.people:
                return False
            if self._is_thing(word):
                after = words[at + 1] if at + 1 < len(words) else None
                if after is None or not self._is_thing(after):
                    sure = not bare and not self._lexicon.knows(word.text)
                    return sure or (after is not None and self._acts(word, after))
            elif word.text in lists.breaks or word.text in lists.prepositions or (bare and at):
                return False
        return False

    def _is_thing(self, word: Word) -> bool:
        things = self._lists.not_people
        return word.text in things or (word.text.endswith("s") and word.text[:-1] in things)

    def _acts(self, subject: Word, after: Word) -> bool:
        return self._lexicon.is_verb_form(after.text) and (after.text != after.base or subject.text.endswith("s"))

    def _is_other_language(self, texts: list[str]) -> bool:
        strange = {text for text in texts if not self._is_english(text)}
        return bool(strange) and any(self._speaks(known, texts, strange) for known in self._lists.languages)

    def _speaks(self, known: frozenset[str], texts: list[str], strange: set[str]) -> bool:
        hits, least = sum(text in known for text in strange), _FOREIGN_SHARE * len(texts)
        return hits >= least or (hits > 0 and sum(text in known for text in texts) >= 2 * least)

    def _is_gibberish(self, texts: list[str], named: bool) -> bool:
        if named and len(texts) < _LEAST_WORDS:
            return False
        share = _GIBBERISH_SHARE / 2 if named else _GIBBERISH_SHARE
        return sum(self._is_english(text) for text in texts) < share * max(len(texts), 1)

    def _is_english(self, text: str) -> bool:
        return self._lexicon.knows(text) or text in self._lists.english
